"""Tests of motions: those for `make full` alone, and the cases that stay in `make test`."""

from __future__ import annotations

from collections.abc import Mapping

FULL: Mapping[str, tuple[str, ...]] = {
    "tests/physics/test_accuracy.py": ("test_a_run_keeps_the_tolerance_of_its_scene[augmented-, accuracy: 1.0e-7-*]",),
    "tests/physics/test_assemblies.py": ("test_a_five_bar_whose_end_is_given", "test_a_watt_six_bar", "test_the_command_lists_them"),
    "tests/physics/test_balls.py": ("test_all_methods_move_the_loop_alike",),
    "tests/physics/test_contacts.py": ("test_touching_and_flight_go_on_by_all_methods[recursive-newton*-0]",),
    "tests/physics/test_controllers.py": (
        "test_equal_steps_keep_their_order_2_across_samples[augmented]", "test_equal_steps_keep_their_order_2_across_samples[classical]",
        "test_a_simulation_that_a_host_holds_goes_on_bit_by_bit",
    ),
    "tests/physics/test_energy.py": (
        "test_the_defect_falls_with_the_order[augmented*]", "test_the_defect_falls_with_the_order[classical*]",
        "test_friction_does_the_work_of_the_loads_in_each_step[*-false]", "test_the_warning_is_in_the_terminal_and_beside_the_table",
    ),
    "tests/physics/test_error_estimates.py": ("test_runs_that_agree_by_chance_do_not_promise_much",),
    "tests/physics/test_everyday.py": (
        "test_the_axle_stands_on_its_weight[chirp]", "test_the_platforms_legs_are_as_long_as_its_height_says",
    ),
    "tests/physics/test_explicit.py": ("test_constraints_hold_at_any_penalty[iltis-*]", "test_the_vehicle_over_a_bump"),
    "tests/physics/test_fitted_tyre.py": ("test_the_file_is_what_the_script_finds", "test_the_iltis_brakes_to_rest_in_half_waves"),
    "tests/physics/test_four_bar.py": (
        "test_rk4_keeps_its_order_through_singular_poses[40-10.0-True]", "test_a_file_is_compiled_for_the_integrator_that_is_asked_for",
    ),
    "tests/physics/test_friction.py": (
        "test_pendulum_follows_equations_by_hand[recursive-newton]",
        "test_plane_slider_crank_follows_equations_of_the_plane[recursive-newton]",
        "test_both_methods_have_the_accelerations_of_a_spatial_loop", "test_loads_of_a_loop_do_not_depend_on_the_cut",
    ),
    "tests/physics/test_gears.py": ("test_wheels_and_cams_with_laws[augmented]", "test_wheels_and_cams_with_laws[classical]"),
    "tests/physics/test_held_poses.py": (
        "test_a_host_is_reported_where_a_scene_is_not_made_for_that", "test_simulations_of_a_host_begin_there",
        "test_positions_may_be_where_a_rest_is_sought[augmented]", "test_positions_may_be_where_a_rest_is_sought[classical]",
        "test_hosts_seek_a_rest_near_positions",
    ),
    "tests/physics/test_hill_start.py": (
        "test_a_car_starts_uphill_from_its_rest_on_the_slope", "test_a_car_that_is_not_driven_rolls_back",
    ),
    "tests/physics/test_hydraulics.py": ("test_no_oil_is_lost",),
    "tests/physics/test_iltis_driven.py": (
        "test_the_lane_is_changed", "test_a_sine_with_dwell_is_measured_in_what_0_3_g_takes", "test_stability_control_ends_the_turn",
        "test_the_anti_lock_brake_stops_shorter_and_straight", "test_a_start_uphill", "test_gears_are_changed",
        "test_a_step_of_the_steering_wheel_turns_the_car", "test_a_road_that_winds_is_followed",
    ),
    "tests/physics/test_iltis_references.py": (
        "test_nothing_strays_along_directions_without_stiffness", "test_nominal_forces", "test_sine_steer_needs_the_spin_of_the_wheels",
    ),
    "tests/physics/test_iltis_scenes.py": (
        "test_simul1_peak_acceleration_is_that_of_the_converged_motion", "test_ten_kilometres_away_the_run_is_the_same",
        "test_simul1s_needs_the_papers_smaller_step", "test_simul3_turns_as_hard_as_the_paper_says",
        "test_mirrored_bumps_roll_the_car_the_other_way", "test_operations_of_an_evaluation_stay_what_they_are[proximal*]",
        "test_simul2_jumps", "test_operations_of_an_evaluation_stay_what_they_are[solved-*]",
    ),
    "tests/physics/test_impacts.py": (
        "test_steps_leave_no_jump_out_between_them[augmented]", "test_steps_leave_no_jump_out_between_them[classical]",
    ),
    "tests/physics/test_inverse.py": ("test_drives_may_be_joints_that_stand_still_or_would_be_cut",),
    "tests/physics/test_lagrangian.py": (
        "test_every_scene", "test_errors_of_the_scene_as_it_stands", "test_residuals_are_reported_for_each_step",
        "test_operations_of_assembly_stay_what_they_are", "test_results_up_to_a_failure_are_kept", "test_in_phase_bump",
    ),
    "tests/physics/test_lossless_wheels.py": ("test_a_driven_calspan_wheel_makes_no_energy_but_by_its_thrust_of_camber",),
    "tests/physics/test_proximal.py": (
        "test_a_penalty_is_an_upper_bound[iltis-*]", "test_forty_windows_pass_as_one_does",
        "test_constraints_hold_at_any_penalty[iltis-*]", "test_the_vehicle_moves_as_with_a_penalty",
    ),
    "tests/physics/test_recursive_newton.py": (
        "test_long_steps_on_stiff_bumpers", "test_steps_in_parts", "test_constraints_hold_at_any_penalty_from_the_least_on[andrews]",
        "test_constraints_hold_at_any_penalty_from_the_least_on[iltis]", "test_short_steps_keep_their_factors",
    ),
    "tests/physics/test_signals.py": (
        "test_hosts_of_fmus", "test_an_image_moves_as_its_original[augmented]", "test_an_image_moves_as_its_original[classical]",
        "test_a_host_that_starts_at_rest", "test_a_simulation_that_a_host_holds",
        "test_loops_with_controllers_move_alike_by_all_methods[augmented]",
        "test_loops_with_controllers_move_alike_by_all_methods[classical]", "test_generated_code_has_the_motion_of_the_interpreter",
    ),
    "tests/physics/test_slip.py": ("test_slip_of_the_moment_is_that_of_a_patch_in_the_end",),
    "tests/physics/test_solved.py": ("test_a_plate_on_light_rods_keeps_its_energy[1e-09]",),
    "tests/physics/test_start.py": (
        "test_given_coordinates_beside_assembled_places_keep_the_assembly_too",
        "test_a_choice_of_independent_coordinates_outlasts_a_reset",
        "test_the_iltis_has_nine_speeds_besides_the_one_that_its_scene_gives",
    ),
    "tests/physics/test_starts.py": (
        "test_a_truck_and_trailer_at_20_m_s", "test_a_motorcycle_that_leans", "test_a_car_on_its_tyres",
        "test_the_iltis_on_softer_tyres", "test_a_car_on_a_circle",
    ),
    "tests/physics/test_states.py": (
        "test_a_simulation_that_a_host_holds_has_states[recursive]", "test_hosts_of_fmus_integrate_states",
        "test_a_simulation_that_a_host_holds_has_states[recursive-newton]", "test_loops_move_as_without_states[augmented]",
        "test_loops_move_as_without_states[classical]", "test_generated_code_has_the_motion_of_the_interpreter",
    ),
    "tests/physics/test_steady_motions.py": ("test_a_library_car_on_a_circle", "test_the_motion_is_steady[text7]"),
    "tests/physics/test_terrain.py": (
        "test_a_host_gives_it_before_each_step", "test_a_host_has_inputs_that_no_file_names",
        "test_a_car_comes_to_rest_wherever_the_ground_lifts_it", "test_a_wheel_whose_forces_read_its_contact_has_it_too",
    ),
    "tests/physics/test_trim_gradients.py": ("test_derivatives_are_exact[text5*]",),
    "tests/physics/test_trims.py": ("test_c99_says_that_the_start_is_trimmed_once",),
    "tests/physics/test_turn_slip.py": ("test_a_little_camber_acts_as_without_turn_slip",),
    "tests/physics/test_two_track.py": (
        "test_a_car_on_stiff_tyres_is_the_rigid_one[braking*", "test_a_car_on_stiff_tyres_is_the_rigid_one[sine*",
    ),
    "tests/physics/test_tyre_ranges.py": (
        "test_a_wheel_lifts_and_lands", "test_steady_slip_at_low_speed_has_the_force_of_the_printed_equations",
    ),
    "tests/physics/test_verification.py": (
        "test_the_benchmark_has_a_line_for_every_problem", "test_second_order[A05*]", "test_second_order_of_newtons_iteration[A03*]",
        "test_second_order_of_newtons_iteration[SC3D*]", "test_published_values[A05*]", "test_errors_of_the_scene_as_it_stands[A05*]",
        "test_lanes_change_nothing",
    ),
    "tests/physics/test_wheels.py": (
        "test_a_wheel_in_the_mirror_is_the_image[]", "test_all_methods_brake_alike", "test_the_tangent_of_a_wheel_on_a_surface",
        "test_a_wheel_rolls_from_a_pose_at_rest", "test_a_braked_wheel_is_pushed_off_at_the_limit_of_friction",
        "test_the_friction_of_a_road_is_that_of_the_scaling_factors", "test_a_tyre_at_rest_does_no_work_while_its_load_changes",
        "test_limits_hold_slip_and_load_of_the_formula",
    ),
    "tests/physics/test_wrong_trims.py": (
        "test_wrong_requests[text1-*]", "test_wrong_requests[text6-*]", "test_wrong_requests[text8-*]",
        "test_wrong_starts_of_a_loop[trim: *]",
    ),
}  # fmt: skip

KEPT: Mapping[str, Mapping[str, tuple[str, ...]]] = {
    "tests/physics/test_error_estimates.py": {
        "test_what_has_converged_is_not_told_too_small": ("crank-Coulomb", "rocker-steep, stop", "yoke-viscous"),
    },
    "tests/physics/test_balls.py": {
        "test_a_damper_alone_and_a_spring_at_rest_elsewhere": ("bodies0-recursive", "bodies1-recursive-newton"),
    },
    "tests/physics/test_branches.py": {
        "test_equal_steps_stay": ("rhombus-*", "equal bars-0.02"),
    },
    "tests/physics/test_first_touch.py": {
        "test_equal_steps_go_on_over_the_first_touch": ("ball-*", "cam-recursive-trapezoidal-crossed", "link-recursive-newton-*"),
        "test_lagrangian_steps_go_on_over_the_first_touch": ("ball-*", "foot-augmented"),
    },
    "tests/physics/test_four_bar.py": {
        "test_equal_steps_without_settings_pass_singular_poses_or_stop_there": ("*-0.001", "trapezoidal-0.01", "rk4-0.010*"),
        "test_equal_steps_of_the_recursion_pass_singular_poses": ("trapezoidal-0.01", "rk4-0.010*", "rk4-0.004"),
        "test_rk4_keeps_its_order_through_singular_poses": ("2-10.0-False", "2-10.0-True", "10-5.0-False"),
    },
    "tests/physics/test_friction_axes.py": {
        "test_friction_at_a_rod_has_the_force_across_its_axis": ("angle_1-forwards-*",),
        "test_friction_of_a_bent_shaft_has_the_force_across_the_angular_velocity": ("angle_1-forwards-*", "angle_2-backwards-recursive"),
        "test_tangent_has_the_change_of_the_axis": ("angle_2-*",),
    },
    "tests/physics/test_gears.py": {
        "test_trapezoidal_rule": ("*recursive", "recursive*"),
    },
    "tests/physics/test_iltis_scenes.py": {
        "test_the_papers_scenes_run_ten_seconds_at_the_papers_step": ("simul3",),
    },
    "tests/physics/test_impacts.py": {
        "test_random_mechanisms_are_struck_as_by_dense_algebra": ("loops4",),
        "test_a_loop_that_is_turned_or_mirrored_is_struck_alike": ("recursive-*", "augmented-mirrored"),
    },
    "tests/physics/test_implicit.py": {
        "test_a_loose_iteration_leads_at_small_steps": ("1e-08-*",),
        "test_generalised_alpha_is_of_second_order": ("0.8-A03*", "1.0-A05*"),
    },
    "tests/physics/test_lagrangian.py": {
        "test_every_scene": ("simul1-classical",),
        "test_errors_of_the_scene_as_it_stands": ("A0[123]-*", "A05-classical", "SC3D-*"),
        "test_second_order": ("A01-*", "A02-*"),
    },
    "tests/physics/test_lossless_wheels.py": {
        "test_a_tyre_never_makes_energy": ("0-10.0",),
        "test_check_reports_the_power_that_a_file_makes": ("0",),
    },
    "tests/physics/test_massless_middles.py": {
        "test_every_method_moves_a_massless_body_as_one_of_hardly_any_mass": ("universal skew B",),
    },
    "tests/physics/test_proximal.py": {
        "test_constraints_hold_at_any_penalty": ("four_bar-*", "slider_crank-*", "andrews-*", "iltis-simul1-*"),
        "test_a_penalty_is_an_upper_bound": ("four_bar-*", "slider_crank-*", "andrews-*", "iltis-simul1-*"),
        "test_forty_windows_pass_as_one_does": ("0.001",),
        "test_singular_poses_are_passed_in_order": ("1-*", "2-0.002"),
    },
    "tests/physics/test_recursive_newton.py": {
        "test_iterations_on_stiff_bumpers": ("0.01-*",),
        "test_very_long_steps_on_stiff_bumpers": ("0.02",),
    },
    "tests/physics/test_signals.py": {
        "test_methods_and_integrators": ("motor-*-trapezoidal", "carts-*-dormand-prince", "carts-*-radau5"),
    },
    "tests/physics/test_slip.py": {
        "test_a_brush_tyre": ("0-0.02-*", "1-0.3-*", "1--0.05-*"),
        "test_a_wheel_that_has_slid_rolls_on": ("brake-*",),
    },
    "tests/physics/test_starts.py": {
        "test_a_table_on_feet_that_stick": ("0.3-1000.0-1.0",),
    },
    "tests/physics/test_steady_motions.py": {
        "test_a_motorcycle_of_two_bodies_on_wheels": ("4.0",),
    },
    "tests/physics/test_rolling_trims.py": {
        "test_a_wheel_without_torque_rolls": ("mf52-*",),
    },
    "tests/physics/test_two_track.py": {
        "test_a_car_in_the_plane": ("braking*",),
    },
    "tests/physics/test_tyre_ranges.py": {
        "test_a_wheel_rests_on_the_edge_of_a_step": ("52-0.0", "62-0.05"),
    },
    "tests/physics/test_wheels.py": {
        "test_forces_are_those_of_the_tables": ("mf52", "mf62s"),
        "test_the_tangent_of_a_wheel": ("62-, turn_slip: 1",),
        "test_a_braked_wheel_stays_on_a_slope_that_shakes": ("52-recursive-0.001", "62-recursive-newton-0.0075"),
        "test_a_tyre_at_rest_does_no_work": ("52-5",),
        "test_a_wheel_brakes_to_rest": ("recursive-0.001",),
        "test_a_tread_stops_in_five_half_waves": ("62-recursive-0.001",),
    },
}  # fmt: skip
