"""A digest tells apart what behaves differently, whatever it is made of, and nothing else."""

from __future__ import annotations

import functools
import subprocess
import sys
import textwrap
import types
from dataclasses import dataclass, replace

import numpy as np
import pytest

import flexctrl as fc
from flexctrl.study.fingerprint import Untold, digest_of
from flexctrl.study.store import fingerprint


def made(text, name="f", **given):
    """What a piece of the user's own source defines, as if it had been imported."""
    module = types.ModuleType("user")
    module.__dict__.update(given)
    exec(textwrap.dedent(text), module.__dict__)
    return module.__dict__[name]


LAW = """
    class Law:
        inputs, outputs = ("z",), ("lift",)
        def __init__(self, k): self.k = k
        def initial(self): return ()
        def command(self, t, x, y): return [-self.k * y[0] - 2.0]
"""


CLOSED = """
    def outer(k):
        def inner(t):
            return k * t
        return inner
    f = outer({})
"""

DIFFERENT = {
    "a constant": ("def f(t): return 2.0 * t", "def f(t): return 3.0 * t"),
    "an operation": ("def f(t): return 2.0 * t", "def f(t): return 2.0 + t"),
    "what is called": ("import math\ndef f(t): return math.sin(t)", "import math\ndef f(t): return math.cos(t)"),
    "what is enclosed": (CLOSED.format(2.0), CLOSED.format(3.0)),
    "a default": ("def f(t, k=2.0): return k * t", "def f(t, k=3.0): return k * t"),
    "a global": ("K = 2.0\ndef f(t): return K * t", "K = 3.0\ndef f(t): return K * t"),
    "a function that is called": (
        "def g(t): return t\ndef f(t): return g(t)",
        "def g(t): return 2 * t\ndef f(t): return g(t)",
    ),
    "a function inside": (
        "def f(t): return max([1, 2], key=lambda v: v)",
        "def f(t): return max([1, 2], key=lambda v: -v)",
    ),
    "an entry of an array": (
        "import numpy as np\nA = np.eye(3)\ndef f(t): return A @ t",
        "import numpy as np\nA = np.eye(3) + np.eye(3, k=1)\ndef f(t): return A @ t",
    ),
    "a field": (f"{LAW}\n    f = Law(2.0)", f"{LAW}\n    f = Law(3.0)"),
    "a method": (f"{LAW}\n    f = Law(2.0)", f"{LAW.replace('- 2.0', '- 2.5')}\n    f = Law(2.0)"),
    "a method of a base": (
        f"{LAW}\n    class B(Law): pass\n    f = B(2.0)",
        f"{LAW.replace('- 2.0', '- 2.5')}\n    class B(Law): pass\n    f = B(2.0)",
    ),
    "a slot": (
        "class A:\n    __slots__ = ('k',)\nf = A()\nf.k = 1",
        "class A:\n    __slots__ = ('k',)\nf = A()\nf.k = 2",
    ),
    "a bound method": (f"{LAW}\n    f = Law(2.0).command", f"{LAW}\n    f = Law(3.0).command"),
    "a partial": (
        "from functools import partial\nf = partial(pow, 2)",
        "from functools import partial\nf = partial(pow, 3)",
    ),
    "a spline": (
        "from scipy.interpolate import CubicSpline\nf = CubicSpline([0, 1, 2], [0, 1, 0])",
        "from scipy.interpolate import CubicSpline\nf = CubicSpline([0, 1, 2], [0, 2, 0])",
    ),
    "a kind": ("f = 1", "f = 1.0"),
}


@pytest.mark.parametrize("what", DIFFERENT)
def test_what_behaves_differently_is_told_apart(what):
    first, second = DIFFERENT[what]
    assert digest_of(made(first)) == digest_of(made(first))
    assert digest_of(made(first)) != digest_of(made(second))


def test_where_it_is_written_and_what_is_kept_once_computed_does_not_count():
    @dataclass(frozen=True)
    class Path:
        a: float

        @functools.cached_property
        def table(self):
            return object()

    path = Path(2.0)
    before = digest_of(path)
    assert path.table
    assert digest_of(path) == before
    assert digest_of(made("def f(t): return t")) == digest_of(made("\n\n# lower down\ndef f(t): return t"))


def test_a_module_of_the_users_counts_by_what_is_used_of_it():
    def using(k, unused):
        own = types.ModuleType("own")
        own.k, own.unused, own.itself = k, unused, own
        return made("def f(t): return own.k * own.itself.k * t", own=own)

    assert digest_of(using(2.0, 1)) == digest_of(using(2.0, 2))
    assert digest_of(using(2.0, 1)) != digest_of(using(3.0, 1))


def test_what_leads_back_to_itself_has_a_digest():
    around = made("def g(t): return f(t - 1) if t else 0\ndef f(t): return g(t)")
    ring = []
    ring.append(ring)
    assert digest_of(around)
    assert digest_of(ring) != digest_of([])


@pytest.mark.parametrize(
    "text",
    [
        "def f(t): return open('table').read()",
        "import time\ndef f(t): return time.time()",
        "import numpy as np\ndef f(t): return np.random.normal()",
        "import numpy as np\ndef f(t): return np.loadtxt('table')",
        "def f(t):\n    import os\n    return os.environ['K']",
        "def f(t):\n    from . import own\n    return own.k",
        "import user\ndef f(t): return getattr(user, 'k' * int(t))",
        "f = (i for i in range(3))",
        "import threading\nf = [threading.Lock()]",
    ],
)
def test_what_is_not_settled_by_what_it_is_made_of_is_refused(text, monkeypatch):
    monkeypatch.setitem(sys.modules, "user", types.ModuleType("user"))
    with pytest.raises(Untold):
        digest_of(made(text))


def test_seeded_noise_is_settled():
    text = (
        "import numpy as np\nrng = np.random.default_rng({})\ndata = rng.normal(size=9)\ndef f(t): return data[int(t)]"
    )
    first, second = (digest_of(made(text.format(seed))) for seed in (1, 2))
    assert first != second
    assert first == digest_of(made(text.format(1)))


def scene(controller=None, **changes):
    hook = fc.PointMass("hook", (0, 0, -3), 40.0)
    rope = fc.Rope("rope", (0, 0, 0), (0, 0, -3), EA=2e5)
    structure = fc.Structure(
        [rope, hook],
        [fc.Support(rope.start, "u v w"), fc.Pin(rope.end, hook.node)],
        inputs=[fc.Force("lift", hook.node, "z")],
        outputs=[fc.Position("z", hook.node, "z")],
    )
    plan = fc.Simulation(until=0.2, every=0.01)
    return replace(fc.Scene(structure, controller=controller, simulation=plan, name="hook"), **changes)


def test_all_that_a_run_depends_on_tells_scenes_apart():
    law = made(LAW, "Law")
    scenes = [
        scene(),
        scene(law(2.0)),
        scene(law(3.0)),
        scene(made(LAW.replace("- 2.0", "- 2.5"), "Law")(2.0)),
        scene(loads={"lift": 5.0}),
        scene(loads={"lift": made("f = lambda t: 5.0 * t")}),
        scene(loads={"lift": made("f = lambda t: 6.0 * t")}),
        scene(hold={"hook_w": 0.0}),
        scene(rest_inputs={"lift": 1.0}),
        scene(effects=(fc.Gravity((0.0, 0.0, -5.0)), fc.RopeStretch(), fc.LargeRotation())),
        scene(simulation=fc.Simulation(until=0.3, every=0.01)),
        scene(simulation=fc.Simulation(until=0.2, every=0.01, start=fc.Start.EQUILIBRIUM)),
    ]
    assert len({fingerprint(s) for s in scenes}) == len(scenes)
    same = scene(
        law(2.0), notes=("a remark",), simulation=replace(scene().simulation, method=fc.GeneralizedAlpha(0.01))
    )
    assert fingerprint(same) == fingerprint(scenes[1])
    assert same.model.n
    assert fingerprint(same) == fingerprint(scenes[1])


@pytest.mark.slow
def test_another_process_finds_the_same():
    """Neither addresses nor the order in which sets are kept (which differ from process to process) have a say."""
    code = (
        "from flexctrl.study.fingerprint import digest_of; import flexctrl as fc\n"
        "class Law:\n    def command(self, t, x, y): return t in {'a', 'b', 'c', 1.5}\n"
        "print(digest_of([Law(), frozenset('abcdef'), fc.cranes.ceiling_crane(), fc.Status.FINISHED]))"
    )
    found = {subprocess.run([sys.executable, "-c", code], capture_output=True, text=True).stdout for _ in range(2)}
    assert len(found) == 1
    assert len(found.pop()) == 65


def test_an_own_object_of_foreign_make_counts_with_what_it_is_copied_by():
    steps = np.random.RandomState(3)
    assert digest_of(steps) == digest_of(np.random.RandomState(3))
    assert digest_of(steps) != digest_of(np.random.RandomState(4))
