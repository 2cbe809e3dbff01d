"""One BLAS thread a worker: many small solves, several workers."""

import os
import sys
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
)
"""Cases whose neighbours hold the same: run with -m long."""


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark the long cases."""
    for item in items:
        if item.nodeid.endswith(LONG):
            item.add_marker("long")


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the option that rewrites the pages of docs/validation; see tests/recorder.py."""
    parser.addoption("--validation-pages", action="store_true", help="rewrite docs/validation from the cases that run")


@pytest.fixture(autouse=True)
def _closed_figures() -> Iterator[None]:
    """Pictures of one test are not those that python-control draws into in the next."""
    yield
    if "matplotlib.pyplot" in sys.modules:
        sys.modules["matplotlib.pyplot"].close("all")
