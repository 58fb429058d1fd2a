"""Tests of C exports and loaded simulations: those for `make full` alone, and the cases that stay in `make test`."""

from __future__ import annotations

from collections.abc import Mapping

FULL: Mapping[str, tuple[str, ...]] = {
    "tests/standalone/test_c99.py": (
        "test_steps_have_the_bits_of_the_cpp_export[pushed rk4]", "test_steps_have_the_bits_of_the_cpp_export[press*]",
        "test_what_is_set_before_the_start_counts_there",
        "test_libraries_of_one_name_in_one_program_keep_their_own_tables",
    ),
    "tests/standalone/test_c_export.py": (
        "test_a_folder_goes_without_vector_mathematics", "test_random_calls_under_sanitizers", "test_a_project_takes_it_in_both_ways",
        "test_files_include_the_standard_library_alone", "test_a_shared_library_shows_the_interface_alone",
        "test_the_code_calls_mathematics_and_nothing_else", "test_vectors_that_a_processor_lacks_bring_no_warnings",
        "test_two_models_in_one_program", "test_a_force_that_was_left_out_and_would_act_ends_the_motion", "test_any_name_will_do",
        "test_the_example_steers_what_moves_no_guide", "test_its_table_is_that_of_the_command_line_bit_by_bit",
    ),
    "tests/standalone/test_checks.py": (
        "test_a_header_of_another_version_does_not_link", "test_names_are_known_when_a_host_is_compiled",
    ),
    "tests/standalone/test_derivatives.py": (
        "test_at_rest_eigenvalues_are_those_of_the_modes",
        "test_the_code_calls_mathematics_and_nothing_else", "test_what_cannot_be_linearised_is_reported", "test_a_wheel_on_a_road",
        "test_a_ball_that_has_turned_far_is_ill_conditioned", "test_a_pendulum_that_swings", "test_laws_have_the_derivatives_of_sympy",
        "test_where_functions_are_infinitely_steep_what_stays_has_no_derivative", "test_a_cart_with_a_pole[recursive-newton]",
        "test_derivatives_are_those_of_differences_in_113_bits", "test_derivatives_of_all_that_laws_see", "test_calls_right_and_wrong",
        "test_the_command_adds_derivatives",
    ),
    "tests/standalone/test_dop853.py": ("test_hosts_have_one_table",),
    "tests/standalone/test_dynamics.py": (
        "test_bodies_move_and_weigh_as_their_jacobians_say[flyball-100]", "test_a_cart_with_a_pole",
        "test_what_cannot_be_asked_is_reported",
    ),
    "tests/standalone/test_event_derivatives.py": (
        "test_the_command_has_the_first_event", "test_a_ball_that_bounces[text3-*]", "test_a_force_that_ends_at_a_time",
        "test_a_ball_that_bounces[text0-*]", "test_a_ball_that_bounces[text2-*]", "test_a_ball_that_bounces[text4-*]",
        "test_a_ball_that_bounces[text5-*]", "test_a_force_that_ends_at_a_time[dormand-prince]",
        "test_guides_and_loops_at_forces_that_jump", "test_adjoints_go_back_over_events", "test_a_table_has_kinks_that_make_no_jump",
        "test_what_has_no_derivative_is_reported_by_name", "test_the_command_needs_numbers_by_which_an_event_changes",
    ),
    "tests/standalone/test_external_wrenches.py": (
        "test_an_external_wrench_is_the_load_that_a_model_file_names", "test_an_external_wrench_is_what_the_jacobian_of_its_point_says",
        "test_the_folder_and_the_fmu_have_the_inputs",
    ),
    "tests/standalone/test_frequency_response.py": (
        "test_a_half_car_on_two_posts_responds_as_its_matrices_say", "test_a_two_mass_drive_has_its_antiresonance_and_margins",
        "test_a_cart_pole_under_sampled_state_feedback_has_its_exact_discrete_transfer",
        "test_the_command_writes_tables_plots_and_errors",
        "test_rear_wheels_follow_front_wheels_and_tracks_have_the_coherence_of_an_isotropic_surface",
    ),
    "tests/standalone/test_held.py": ("test_what_is_held_stays_current[rk4]",),
    "tests/standalone/test_impacts.py": (
        "test_a_cart_takes_its_rod_along[0.2037-recursive-newton-radau5-located]",
        "test_a_cart_takes_its_rod_along[0.2037-augmented-*]", "test_an_event_of_an_fmu_is_the_impact",
        "test_a_sweep_has_the_rows_of_single_runs", "test_a_loaded_simulation_tells_of_the_event", "test_an_fmu_has_the_rows_of_a_run",
        "test_steps_are_those_of_the_command_line", "test_a_loop_is_struck_as_by_dense_algebra", "test_the_code_takes_no_memory",
        "test_a_host_goes_back_behind_a_jump[augmented*]", "test_a_snapshot_before_a_jump_and_one_behind_it_go_on_alike",
        "test_a_batch_and_a_rollout_have_the_ends_of_single_runs",
    ),
    "tests/standalone/test_inputs.py": (
        "test_a_host_that_sets_the_laws_of_the_scene_has_its_motion",
        "test_a_step_begins_with_the_acceleration_that_an_input_gives_as_it_jumps[classical-*]",
        "test_a_step_begins_with_the_acceleration_that_an_input_gives_as_it_jumps[augmented-single]",
        "test_a_step_begins_with_the_acceleration_that_an_input_gives_as_it_jumps[recursive-newton-coupled]",
        "test_a_step_begins_with_the_acceleration_that_an_input_gives_as_it_jumps[recursive-single]",
        "test_a_value_that_is_written_is_held_whatever_was_given_before[augmented]", "test_guides_take_rate_and_acceleration[augmented]",
        "test_simulations_in_lanes_have_inputs_of_their_own", "test_values_written_into_the_array_are_held[augmented]",
    ),
    "tests/standalone/test_inputs_over_time.py": (
        "test_held_values_are_those_of_a_host", "test_states_and_controllers", "test_a_motor_and_a_guide_of_a_loop",
        "test_a_guide_by_a_law_of_a_loop", "test_coupled_stages", "test_events_that_move", "test_calls_right_and_wrong",
    ),
    "tests/standalone/test_integrators.py": (
        "test_restored_moments_go_on_the_same",
        "test_what_an_integrator_has_not_is_refused", "test_inputs_and_parameters_count_from_the_next_step_on",
        "test_the_code_calls_mathematics_and_nothing_else", "test_a_tolerance_is_kept", "test_steps_end_at_events",
        "test_a_time_that_rounding_parts_from_the_end_of_a_step_is_reached",
        "test_who_looks_on_changes_nothing[recursive-dormand-prince]",
    ),
    "tests/standalone/test_load_derivatives.py": ("test_derivatives_by_a_mass_over_a_load_that_passes_zero[*back*]",),
    "tests/standalone/test_moved_bases.py": ("test_a_shaken_table_moves_its_load_as_the_closed_form_says",),
    "tests/standalone/test_newton_derivatives.py": (
        "test_forces_between_knots", "test_the_generalised_alpha_method_with_states_and_controllers", "test_a_slider_crank",
        "test_the_press_and_its_hardpoint", "test_balls_in_a_loop",
    ),
    "tests/standalone/test_other_processors.py": ("test_a_run_has_the_numbers_of_this_machine",),
    "tests/standalone/test_poses.py": (
        "test_arrays_are_views_and_asking_changes_no_step", "test_contacts_are_where_planes_of_wheels_meet_the_ground",
        "test_a_program_in_c_has_them",
    ),
    "tests/standalone/test_radau_derivatives.py": (
        "test_chains_balls_states_and_controllers", "test_a_step_that_ends_at_an_event_has_none", "test_the_command_has_the_method",
        "test_no_number_is_read_before_it_is_written", "test_loops_near_a_dead_centre_come_nearer_with_shorter_steps",
        "test_loops_at_a_force_that_jumps[radau5-fixed]", "test_a_pendulum_by_gravity_in_steps_that_follow_errors",
        "test_a_loop_and_its_hardpoint", "test_a_ball_that_bounces", "test_a_force_that_ends_at_a_time",
    ),
    "tests/standalone/test_run_adjoints.py": (
        "test_what_cannot_be", "test_chains_states_and_controllers",
        "test_chains_states_and_controllers[text2-*]", "test_chains_states_and_controllers[text3-*]", "test_loops[rk4]",
        "test_a_hardpoint_of_loops_that_functions_close", "test_a_pendulum_by_gravity",
        "test_the_command_goes_backwards_for_many_numbers", "test_a_pose_at_rest_follows_its_closed_form",
        "test_the_command_lets_a_pose_at_rest_change", "test_chains_states_and_controllers[text1*]",
        "test_chains_states_and_controllers[text4*]",
    ),
    "tests/standalone/test_run_derivatives.py": (
        "test_objectives_have_the_derivatives_of_their_values", "test_coordinates_are_chosen_again_where_they_become_ill_conditioned",
        "test_what_has_none_is_reported",
        "test_many_hardpoints_of_embedded_loops_side_by_side", "test_a_slope_that_is_no_number_beside_others",
        "test_a_slope_that_is_no_number_beside_others[rk4]", "test_loops_by_explicit_steps_near_a_dead_centre[rk4]",
        "test_states_and_controllers_that_take_samples", "test_a_chain", "test_a_pendulum_by_gravity", "test_a_loop_by_a_hardpoint",
        "test_loops_by_the_trapezoidal_rule", "test_a_linear_motion[rk4*]",
    ),
    "tests/standalone/test_settings.py": (
        "test_a_moment_after_steps_changed_goes_on_the_same",
        "test_expressions_of_the_step_follow_it", "test_a_moment_after_steps_changed_goes_on_the_same[recursive-newton]",
    ),
    "tests/standalone/test_simulation.py": (
        "test_rollout_in_lanes_of_what_is_linearised_too", "test_steps_are_those_of_the_command_line_bit_by_bit[augmented]",
        "test_parameters_change_between_steps[augmented]", "test_given_states_count_once_a_pose_at_rest_is_found",
        "test_rollout_with_inputs_of_each_step",
    ),
    "tests/standalone/test_sizes.py": ("test_a_simulation_takes_no_more_than_its_bound",),
    "tests/standalone/test_start_derivatives.py": (
        "test_an_eigenvalue_that_repeats_has_none", "test_a_start_that_is_found_changes_with_what_it_is_found_by",
        "test_a_kink_at_the_pose_has_none",
    ),
    "tests/standalone/test_steering.py": (
        "test_a_law_that_is_held_over_several_steps_is_followed",
        "test_a_ramp_to_where_the_loop_cannot_close_tears_it[recursive-newton-*]",
        "test_a_jump_is_made_in_two_steps_without_going_beyond[recursive-newton-*]", "test_simulations_in_lanes_follow_as_one_alone",
        "test_a_law_that_is_held_step_by_step_is_followed", "test_lanes_that_go_alone_change_no_bit_of_others",
        "test_a_jump_in_short_steps_ends_where_it_was_to_end[recursive-newton*]",
    ),
    "tests/standalone/test_step_derivatives.py": (
        "test_loops_by_the_fixed_point_with_and_without_a_jump_of_an_input", "test_a_linear_motion[recursive-rk4-*]",
        "test_methods_have_the_same_without_loops", "test_a_controller_holds_within_a_step_that_its_sample_divides",
        "test_a_step_that_ends_at_an_event_has_none", "test_loops_by_newtons_iteration_come_nearer_with_shorter_steps",
        "test_adaptive_steps_have_the_derivatives_of_the_motion",
    ),
    "tests/standalone/test_step_statistics.py": ("test_the_pivot_is_that_of_the_elimination",),
    "tests/standalone/test_table_derivatives.py": ("test_a_monotone_curve_beside_differences",),
    "tests/standalone/test_tangents.py": ("*",),
    "tests/standalone/test_wasm.py": (
        "test_a_reproducible_folder_has_the_bits_of_the_module[press-recursive-newton-*]",
        "test_a_reproducible_folder_has_the_bits_of_the_module[four_bar-*]",
        "test_a_reproducible_folder_has_the_bits_of_the_module[slider_crank-*]",
        "test_a_reproducible_folder_has_the_bits_of_the_module[press-recursive-trapezoidal-*]",
        "test_a_module_moves_as_the_native_core[slider_crank-*]", "test_a_module_moves_as_the_native_core[delta-*]",
    ),
}  # fmt: skip

KEPT: Mapping[str, Mapping[str, tuple[str, ...]]] = {
    "tests/standalone/test_c_export.py": {
        "test_calls_right_and_wrong": ("recursive",),
    },
    "tests/standalone/test_c99.py": {
        "test_a_mechanism_of_centimetres_compiles": ("short rk4",),
    },
    "tests/standalone/test_checks.py": {
        "test_flags_that_change_the_numbers_are_refused": ("flags0-*-g++", "flags1-*-g++"),
    },
    "tests/standalone/test_derivatives.py": {
        "test_the_code_calls_mathematics_and_nothing_else": ("flyball-recursive-clang++",),
        "test_at_rest_eigenvalues_are_those_of_the_modes": ("recursive",),
        "test_what_does_not_move_stands_still": ("recursive",),
    },
    "tests/standalone/test_frequency_response.py": {
        "test_a_drive_with_backlash_is_linearised_on_its_flank_or_between_them": ("0.0-*",),
    },
    "tests/standalone/test_impacts.py": {
        "test_a_cart_takes_its_rod_along": (
            "0.2037-recursive-trapezoidal-crossed", "0.2037-recursive-newton-radau5-located", "0.2037-augmented-trapezoidal-crossed",
        ),
        "test_a_host_goes_back_behind_a_jump": (
            "*recursive-trapezoidal-crossed", "*recursive-newton-radau5-located", "*augmented-trapezoidal-crossed",
        ),
        "test_an_fmu_has_the_rows_of_a_run": ("recursive-trapezoidal-crossed-3",),
    },
    "tests/standalone/test_inputs.py": {
        "test_inputs_that_nobody_sets_follow_the_scene": ("recursive",),
        "test_steps_keep_their_order_where_a_host_makes_an_input_jump": ("recursive",),
        "test_a_host_that_sets_the_laws_of_the_scene_has_its_motion": ("recursive",),
        "test_guides_take_rate_and_acceleration": ("recursive", "augmented"),
        "test_a_value_that_is_written_is_held_whatever_was_given_before": ("recursive", "augmented"),
        "test_values_written_into_the_array_are_held": ("recursive", "augmented"),
        "test_a_step_begins_with_the_acceleration_that_an_input_gives_as_it_jumps": ("recursive-coupled",),
    },
    "tests/standalone/test_integrators.py": {
        "test_equal_steps_are_those_of_the_command_line_bit_by_bit": ("press-0.002-*",),
        "test_restored_moments_go_on_the_same": ("recursive-dormand-prince", "recursive-newton-radau5-fixed"),
        "test_who_looks_on_changes_nothing": ("recursive-dormand-prince", "recursive-newton-radau5-fixed"),
    },
    "tests/standalone/test_settings.py": {
        "*": ("recursive", "recursive-newton"),
    },
    "tests/standalone/test_simulation.py": {
        "*": ("recursive", "recursive-newton"),
        "test_a_state_is_set": ("recursive",),
    },
    "tests/standalone/test_step_derivatives.py": {
        "test_a_motion_that_is_wholly_prescribed_has_no_states": ("trapezoidal",),
    },
    "tests/standalone/test_steering.py": {
        "test_a_jump_is_made_in_two_steps_without_going_beyond": ("recursive-trapezoidal-", "recursive-newton-radau5-"),
        "test_a_ramp_to_where_the_loop_cannot_close_tears_it": ("recursive-trapezoidal-", "recursive-newton-radau5-"),
        "test_a_jump_in_short_steps_ends_where_it_was_to_end": ("recursive-trapezoidal-", "recursive-newton-radau5-"),
        "test_another_fault_blames_no_loop": ("recursive",),
        "test_a_reset_forgets_derivatives": ("recursive",),
    },
}  # fmt: skip
