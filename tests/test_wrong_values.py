"""Wrong values of every argument of every public name: what is refused is refused by name, never by a raw traceback."""

from __future__ import annotations

import inspect

import pytest
import wrong_values as good

import flexctrl as fc
from flexctrl import design
from flexctrl.errors import FlexctrlError

GROUPS = (good.STRUCTURE, good.EFFECT, good.MODELS, good.RUNS, good.LAWS, good.STUDIES, good.PLOTS)
CALLS = {name: call for group in GROUPS for name, call in group.items()}
NUMBERS = ["a", float("nan"), -1.0]
WRONG = [*NUMBERS, None, 3, object(), [1, "b"], {"no_such": 1.0}, True, int]


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("name", CALLS)
def test_what_is_refused_is_refused_by_name(name):
    call, arguments = CALLS[name]
    if name not in good.SLOW and not name.startswith("load_"):
        call(**arguments)
    for what in arguments:
        for value in NUMBERS if name in good.SLOW else WRONG:
            try:
                call(**{**arguments, what: value})
            except FlexctrlError:
                continue
            except Exception as error:
                pytest.fail(f"{name}({what}={value!r}): {type(error).__name__}: {error}")


def test_every_public_name_with_arguments_is_asked():
    names = {n: getattr(home, n) for home in (fc, design) for of in home._HOMES.values() for n in of}
    calls = set(names) - set(CALLS) - set(good.RESULTS)
    assert {name for name in calls if callable(names[name]) and inspect.signature(names[name]).parameters} == set()


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: design.MinimumJerk("1", 2.0), "MinimumJerk: distance = '1'; expected a number"),
        (lambda: design.Shaped(good.MOVE, 3.0), "Shaped: shaper = 3.0; expected one, as zvd"),
        (
            lambda: design.lqr(good.LINEAR, good.Q, good.R),
            "lqr: plant = .*expected a control.StateSpace, as linear.to_ss",
        ),
        (lambda: good.LINEAR.to_ss(modes=3), "modes = 3; expected Modes, as linear.modes"),
        (lambda: fc.audit(good.PENDULUM), "audit: model = .*expected a Model"),
        (lambda: fc.sweep(good.MODEL), "is no Scene; give flexctrl.Scene"),
        (lambda: fc.plot_bode(good.RESPONSE, 3), "plot: axes = 3; expected two axes"),
        (lambda: fc.load_scene(3), "load_scene: path = 3; expected the name of a"),
        (lambda: fc.Noisy(good.SAMPLED, seed="a"), "seed = 'a' must be a whole number"),
    ],
)
def test_the_message_names_the_argument_its_value_and_what_is_expected(call, message):
    with pytest.raises(FlexctrlError, match=message):
        call()
