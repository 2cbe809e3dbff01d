"""One BLAS thread a worker: many small solves, several workers."""

import os
import signal
import sys
import time
from collections.abc import Iterator

import pytest

for _threads in ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OMP_NUM_THREADS"):
    os.environ.setdefault(_threads, "1")
os.environ.setdefault("MPLBACKEND", "Agg")

pytest_plugins = ("recording",)

LONG = (
    "test_diverging_runs.py::test_loops_that_throw_an_arm_away[too high-chosen-plain]",
    "test_diverging_runs.py::test_loops_that_throw_an_arm_away[wrong sign-chosen-plain]",
    "test_diverging_runs.py::test_loops_with_friction_lag_and_play[Backlash-plain]",
    "test_d18_redundant_loops.py::test_ten_seconds[40]",
    "test_watched_and_resumed.py::test_events_that_are_only_watched_change_no_bit[dry-continuous-adaptive]",
    "test_watched_and_resumed.py::test_events_that_are_only_watched_change_no_bit[lag-continuous-adaptive]",
    "test_watched_and_resumed.py::test_events_that_are_only_watched_change_no_bit[dry-continuous-alpha]",
    "test_watched_and_resumed.py::test_events_that_are_only_watched_change_no_bit[dry-none-alpha]",
    "test_watched_and_resumed.py::test_a_run_stopped_anywhere_goes_on_with_the_same_bits[dry-continuous-adaptive-met]",
    "test_watched_and_resumed.py::test_a_run_stopped_anywhere_goes_on_with_the_same_bits[lag-continuous-adaptive-met]",
    "test_watched_and_resumed.py::test_a_run_stopped_anywhere_goes_on_with_the_same_bits[dry-continuous-alpha-met]",
    "test_omissions.py::test_sampling_is_kept_under_what_counts_samples[rate_limited]",
    "test_omissions.py::test_sampling_is_kept_under_what_counts_samples[delayed]",
    "test_cli.py::test_a_cost_that_is_ended_leaves_nothing_running_and_goes_on[15]",
    "test_long_linkages.py::test_hundreds_of_links_run_in_some_hundred_megabytes[rope-1000-900]",
    "test_march_dry.py::test_a_lowered_law_is_asked_while_the_motor_sticks[fixed]",
    "test_events_under_control.py::test_marched_and_plain_runs_tell_the_same[quarters-lowered]",
    "test_random_structures.py::test_steps_end_where_a_damped_gap_closes[5]",
    "test_random_structures.py::test_steps_end_where_a_damped_gap_closes[29]",
    "test_motors_beside_loads.py::test_damped_steps_do_not_lose_it_later[0.005-1000000.0]",
    "test_motors_beside_loads.py::test_damped_steps_do_not_lose_it_later[0.01-10000000.0]",
    "test_friction_in_any_units.py::test_a_block_slips_alike_in_any_units_of_mass[extrapolated-stribeck]",
    "test_friction_in_any_units.py::test_a_block_slips_alike_in_any_units_of_mass[explicit-stribeck]",
    "test_straying.py::test_a_loop_whose_numbers_no_longer_tell_its_machine_has_failed[ExplicitRungeKutta]",
    "test_extrapolated_course.py::test_courses_and_books_keep_their_orders[rocket-alpha]",
    "test_massless_drives.py::test_under_a_continuous_controller_it_moves_as_its_forces_say[ConservingMidpoint-friction]",
    "test_exact_without_mass.py::test_a_continuous_law_from_any_start[1-held-places and rates]",
    "test_exact_without_mass.py::test_a_continuous_law_from_any_start[1-growing-places and rates]",
    "test_continuous_laws.py::test_who_asks_makes_no_difference[integrators that stop-controlled-0.004]",
    "test_continuous_laws.py::test_who_asks_makes_no_difference[integrators that stop-controlled-0.0031]",
    "test_ledgers.py::test_the_ledger_keeps_what_matters[flexible_arm]",
    "test_friction_in_any_units.py::test_a_block_slips_alike_in_any_units[0.0-alpha]",
    "test_march_dry.py::test_states_on_the_way_stick_and_slide_as_they_did",
    "test_errors_that_add_up.py::test_steps_of_one_length_tell_what_a_swing_is_off_by[midpoint]",
    "test_resumed_at_switches.py::test_so_do_other_methods_under_a_sampled_controller[extrapolated, chosen]",
    "test_accuracy.py::test_a_coarse_scene_is_judged_by_finer_runs[method1-None]",
    "test_accuracy.py::test_a_ledger_does_not_hang_on_units[mm, t, s]",
    "test_ledgers.py::test_the_ledger_keeps_what_matters[bridge_crane]",
    "test_diverging_runs.py::test_loops_that_throw_an_arm_away[too high-chosen-compiled]",
    "test_diverging_runs.py::test_loops_with_friction_lag_and_play[CoulombFriction-plain]",
    "test_events_under_control.py::test_marched_and_plain_runs_tell_the_same[quarters-own]",
    "test_extrapolated_course.py::test_courses_and_books_keep_their_orders[rocket-ConservingMidpoint]",
    "test_watched_and_resumed.py::test_a_run_stopped_anywhere_goes_on_with_the_same_bits[dry-continuous-adaptive-no]",
    "test_watched_and_resumed.py::test_a_run_stopped_anywhere_goes_on_with_the_same_bits[lag-continuous-adaptive-no]",
    "test_under_a_continuous_controller_it_moves_as_its_forces_say[ConservingMidpoint-stiffness alone]",
    "test_massless_drives.py::test_a_lag_that_steps_do_not_see_leaves_speeds_as_they_are[1e-05]",
    "test_motors_beside_loads.py::test_damped_steps_do_not_lose_it_later[0.005-10000000.0]",
    "test_component_modes.py::test_every_method_of_integration_takes_modes[Richardson of midpoint]",
    "test_march_dry.py::test_marched_friction_is_plain_friction[even-False-fixed]",
    "test_checked.py::test_what_grows_is_told[3-9.0-4]",
    "test_slack_in_small_motion.py::test_so_is_that_of_a_winch[('marched', 20.0)-ExplicitRungeKutta]",
    "test_small_beside_large.py::test_a_load_that_is_nothing_beside_its_motor_sways_all_the_same[1000000000000000.0]",
    "test_a_block_slips_alike_in_any_units_of_mass[alpha-static]",
    "test_a_block_slips_alike_in_any_units_of_mass[alpha-stribeck]",
    "test_sliding_laws.py::test_a_sliding_mode_slides_as_filippov_says[method2-0.004-500]",
    "test_extrapolated_course.py::test_courses_and_books_keep_their_orders[hung-alpha]",
    "test_d23_fast_spin.py::test_heavy_top[Richardson of ConservingMidpoint]",
    "test_d23_fast_spin.py::test_no_artificial_precession[ConservingMidpoint-160.0]",
    "test_untold_functions.py::test_they_go_on_with_the_same_bits[6.004-GeneralizedAlpha]",
    "test_untold_functions.py::test_they_go_on_with_the_same_bits[7.1-GeneralizedAlpha]",
    "test_untold_functions.py::test_they_go_on_with_the_same_bits[5.9999-GeneralizedAlpha]",
    "test_resumed_at_switches.py::test_so_do_other_methods_under_a_sampled_controller[explicit, fixed]",
    "test_march_dry.py::test_samples_and_switches_go_on_bit_for_bit[adaptive]",
    "test_checked.py::test_what_grows_in_steps_of_one_length_is_told[0.005]",
    "test_random_structures.py::test_steps_end_where_a_damped_gap_closes[21]",
    "test_law_states.py::test_anti_windup_slides_along_its_limit[backend5-how5-0.001-gains1]",
    "test_massless_drives.py::test_under_a_continuous_controller_it_moves_as_its_forces_say[GeneralizedAlpha-friction]",
    "test_resumed_at_switches.py::test_so_do_other_methods_under_a_sampled_controller[extrapolated]",
    "test_sliding_laws.py::test_a_sliding_mode_slides_as_filippov_says[method1-0.004-500]",
    "test_angles.py::test_angles_are_integrals_of_spins[tumbler-ConservingMidpoint]",
    "test_friction_in_any_units.py::test_a_block_slips_alike_in_any_units_of_mass[alpha-even]",
    "test_friction_in_any_units.py::test_a_block_slips_alike_in_any_units[0.0-adaptive alpha]",
    "test_checked.py::test_steps_of_one_length_are_checked_too[ConservingMidpoint]",
    "test_watched_and_resumed.py::test_events_that_are_only_watched_change_no_bit[dry-sampled-extrapolated]",
    "test_watched_and_resumed.py::test_events_that_are_only_watched_change_no_bit[play-sampled-midpoint]",
    "test_watched_and_resumed.py::test_events_that_are_only_watched_change_no_bit[dry-none-adaptive]",
    "test_watched_and_resumed.py::test_events_that_are_only_watched_change_no_bit[dry-own-alpha]",
    "test_watched_and_resumed.py::test_events_that_are_only_watched_change_no_bit[play-none-alpha]",
    "test_watched_and_resumed.py::test_events_that_are_only_watched_change_no_bit[lag-sampled-extrapolated]",
    "test_watched_and_resumed.py::test_events_that_are_only_watched_change_no_bit[rope-continuous-adaptive]",
    "test_watched_and_resumed.py::test_events_are_those_of_plain_steps_and_of_longer_runs[play-none-adaptive]",
    "test_watched_and_resumed.py::test_events_are_those_of_plain_steps_and_of_longer_runs[dry-none-adaptive]",
    "test_watched_and_resumed.py::test_events_are_those_of_plain_steps_and_of_longer_runs[play-none-alpha]",
    "test_watched_and_resumed.py::test_events_are_those_of_plain_steps_and_of_longer_runs[play-sampled-alpha]",
    "test_winch.py::test_a_rope_draws_a_car_askew_to_its_guide[True-along1-True]",
    "test_winch.py::test_a_rope_draws_a_car_askew_to_its_guide[True-along1-False]",
    "test_winch.py::test_a_rope_draws_a_car_askew_to_its_guide[True-along2-True]",
    "test_corners_on_rails.py::test_compiled_runs_are_plain_ones[flexible-play-sampled-adaptive]",
    "test_corners_on_rails.py::test_compiled_runs_are_plain_ones[rigid-both-sampled-adaptive]",
    "test_corners_on_rails.py::test_compiled_runs_are_plain_ones[flexible-both-none-adaptive]",
    "test_corners_on_rails.py::test_compiled_runs_are_plain_ones[rigid-play-sampled-adaptive]",
    "test_held_places.py::test_what_rides_on_a_beam_is_held_in_one_place[0.3-turn]",
    "test_held_places.py::test_what_rides_on_a_beam_is_held_in_one_place[0.0-slide]",
    "test_long_linkages.py::test_hundreds_of_links_run_in_some_hundred_megabytes[links-1000-900]",
    "test_d02_massless_angle.py::test_a_massless_motor_under_torques_that_jump[Richardson]",
    "test_angles.py::test_angles_are_integrals_of_spins[tumbler-ExplicitRungeKutta]",
    "test_angles.py::test_angles_are_integrals_of_spins[slider_crank-ConservingMidpoint]",
    "test_what_a_sample_tears_loose_is_told[Richardson(method=GeneralizedAlpha(step=0.005, rho=0.9))]",
    "test_integrators.py::test_order_of_extrapolation_over_chosen_steps[hinges-damped]",
    "test_accuracy.py::test_a_ledger_does_not_hang_on_the_tolerance[1e-09]",
    "test_held_displacements.py::test_an_end_held_at_an_angle_bends_the_beam_to_an_arc[3.0-4]",
    "test_untold_functions.py::test_a_square_wave_jumps_where_it_does[5.0-Richardson]",
    "test_untold_functions.py::test_a_square_wave_jumps_where_it_does[5.0-GeneralizedAlpha]",
    "test_torn_loose_by_a_rope.py::test_friction_brakes_what_the_catch_has_torn_loose[speed0]",
    "test_untold_functions.py::test_they_go_on_with_the_same_bits[6.4-GeneralizedAlpha]",
    "test_minimal_set.py::test_an_unstable_loop_is_noted[2.0-False]",
    "test_impacts.py::test_a_damped_catch_is_the_more_exact_the_less_is_allowed[1824.0-0.21-explicit-compiled]",
    "test_impacts.py::test_a_damped_catch_is_the_more_exact_the_less_is_allowed[1000.0-0.02-explicit-plain]",
    "test_corners_marched.py::test_a_step_onto_a_flank_that_uses_up_its_iterations_is_tried_again[27000.0-1.3]",
    "test_thrown_parts.py::test_a_stop_may_be_met_anywhere_in_a_step[plain-0.001]",
    "test_untold_functions.py::test_a_gust_after_a_long_calm_is_felt[Richardson]",
    "test_memory_of_laws.py::test_friction_under_a_sampled_law_is_that_of_another_method[0.001]",
    "test_checked.py::test_what_grows_is_told[3-8.0-2]",
    "test_friction_in_any_units.py::test_a_command_that_lags_tears_nothing_loose_at_its_sample[fixed]",
    "test_contacts_that_share.py::test_they_stop_and_break_loose_as_one[fixed]",
    "test_contacts_that_share.py::test_they_stop_and_break_loose_as_one[explicit]",
    "test_free_beams.py::test_compiled_steps_of_a_thrown_beam_are_the_plain_ones[40-1000000.0-0.02]",
    "test_d10_stiff_shafts.py::test_all_that_a_linear_model_gives_is_that_behind_a_rigid_shaft[10000000000.0-100-level]",
    "test_corners_on_rails.py::test_compiled_runs_are_plain_ones[flexible-play-none-adaptive]",
    "test_corners_on_rails.py::test_compiled_runs_are_plain_ones[flexible-both-sampled-fixed]",
    "test_corners_on_rails.py::test_compiled_runs_are_plain_ones[rigid-both-none-adaptive]",
    "test_corners_on_rails.py::test_compiled_runs_are_plain_ones[flexible-play-sampled-fixed]",
    "test_corners_on_rails.py::test_compiled_runs_are_plain_ones[flexible-play-none-fixed]",
    "test_corners_on_rails.py::test_compiled_runs_are_plain_ones[rigid-both-sampled-fixed]",
    "test_sheaves.py::test_a_load_hauled_up_stops_at_the_sheave[False-ConservingMidpoint]",
    "test_sheaves.py::test_a_load_hauled_up_stops_at_the_sheave[True-Richardson]",
    "test_sliding_laws.py::test_friction_of_ones_own_sticks_and_breaks_loose[method1]",
    "test_held_displacements.py::test_an_end_held_at_an_angle_bends_the_beam_to_an_arc[2.0-4]",
    "test_untold_functions.py::test_they_go_on_with_the_same_bits[0.5-GeneralizedAlpha]",
    "test_exact_without_mass.py::test_a_continuous_law_from_any_start[1-free-places and rates]",
    "test_small_beside_large.py::test_a_load_that_is_nothing_beside_its_motor_sways_all_the_same[1000000000000.0]",
    "test_extrapolated_steps.py::test_chosen_steps_are_those_of_the_method_and_are_worth_more[tight-bristles]",
    "test_friction_in_any_units.py::test_what_is_as_small_as_it_gets_slips_as_in_units_of_its_own[0.0]",
    "test_a_block_slips_alike_in_any_units_of_mass[adaptive alpha-stribeck]",
    "test_law_states.py::test_anti_windup_slides_along_its_limit[backend5-how5-0.001-gains0]",
    "test_sticking_under_control.py::test_it_comes_to_rest_near_its_target[fixed]",
    "test_first_steps.py::test_what_nothing_sets_going_but_the_clock_is_not_missed[0.1-implicit]",
    "test_omissions.py::test_sampling_is_kept_under_what_counts_samples[noisy]",
)
"""Cases whose neighbours hold the same: run with -m long."""


_FAMILY, _LARGE = 3, ("tests/dynamics/", "tests/effects/", "tests/model/", "tests/study/", "tests/scene/")
"""Of one test in these rooms so many cases are run, evenly spread over all; the others with -m long."""


_LATER = ("tests/dynamics/",)
_LAST = ("tests/study/", "tests/examples/", "tests/test_howto", "tests/test_cli", "tests/test_report")
"""Rooms that take the longest: where time runs out, some of each file have been through, and most others."""
_END = float(os.environ.get("FLEXCTRL_TESTS_END", "inf"))
"""When whatever is left is skipped [s since 1970]: CI has twenty minutes, and its machines are not alike."""


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item: pytest.Item) -> None:
    """Skip what there is no time for, before anything is made for it."""
    if time.time() > _END:
        pytest.skip("no time is left (FLEXCTRL_TESTS_END)")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark the long cases, and those between their like; what takes longest comes last, but for one of each file."""
    families: dict[str, list[pytest.Item]] = {}
    for item in items:
        if item.nodeid.endswith(LONG):
            item.add_marker("long")
        elif not item.get_closest_marker("long"):
            families.setdefault(item.nodeid.partition("[")[0], []).append(item)
    for name, cases in families.items():
        run = {round(i * (len(cases) - 1) / (_FAMILY - 1)) for i in range(_FAMILY)}
        for i, item in enumerate(cases):
            if name.startswith(_LARGE) and len(cases) > _FAMILY and i not in run:
                item.add_marker("long")
    first = {cases[0] for cases in families.values()}
    sample = set({item.nodeid.partition("::")[0]: item for item in reversed(items) if item in first}.values())

    def rank(item: pytest.Item) -> tuple[int, bool]:
        last = item.nodeid.startswith(_LAST)
        if not (last or item.nodeid.startswith(_LATER)):
            return 1, False
        return (0 if item in sample else 2 if item in first else 3), last

    items.sort(key=rank)


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the option that rewrites the pages of docs/validation; see tests/recorder.py."""
    parser.addoption("--validation-pages", action="store_true", help="rewrite docs/validation from the cases that run")


@pytest.fixture(autouse=True)
def _heard() -> Iterator[None]:
    """Ctrl-C is heard as in a terminal, also where tests run in the background, where it is ignored."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.fixture(autouse=True)
def _closed_figures() -> Iterator[None]:
    """Pictures of one test are not those that python-control draws into in the next."""
    yield
    if "matplotlib.pyplot" in sys.modules:
        sys.modules["matplotlib.pyplot"].close("all")
