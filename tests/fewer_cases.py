"""Tests whose cases differ in a kind, a method, a compiler or a version: the cases that stay in `make test`; `make full` has all."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from fnmatch import fnmatchcase

#: Rules of steps that have code of their own: explicit ones, Newton's iteration of a tree, and with impacts natural coordinates.
_WAYS = ("recursive-trapezoidal-", "recursive-newton-radau5-")
_IMPACTS = ("*recursive-trapezoidal-crossed", "*recursive-newton-radau5-located", "*augmented-trapezoidal-crossed")
_EVENTS = ("recursive-dormand-prince", "recursive-newton-radau5-fixed")
_METHODS = ("recursive", "augmented")

#: Tests, or cases of them, that are for `make full` alone, by file: they compile for long what a test beside them compiles in another way,
#: or say of the vehicle what others say of small models.
_FULL: Mapping[str, tuple[str, ...]] = {
    "tests/standalone/test_wasm.py": (
        "test_a_reproducible_folder_has_the_bits_of_the_module[press-recursive-newton-*]",
        "test_a_reproducible_folder_has_the_bits_of_the_module[four_bar-*]",
        "test_a_reproducible_folder_has_the_bits_of_the_module[slider_crank-*]",
        "test_a_reproducible_folder_has_the_bits_of_the_module[press-recursive-trapezoidal-*]",
        "test_a_module_moves_as_the_native_core[slider_crank-*]", "test_a_module_moves_as_the_native_core[delta-*]",
    ),
    "tests/standalone/test_event_derivatives.py": (
        "test_the_command_has_the_first_event",
        "test_a_ball_that_bounces[text3-*]",
        "test_a_force_that_ends_at_a_time",
        "test_guides_and_loops_at_forces_that_jump[rk4-text1-*]", "test_a_ball_that_bounces[text0-*]", "test_a_ball_that_bounces[text2-*]",
        "test_a_ball_that_bounces[text4-*]", "test_a_ball_that_bounces[text5-*]", "test_a_force_that_ends_at_a_time[dormand-prince]",
    ),
    "tests/standalone/test_radau_derivatives.py": (
        "test_a_ball_that_bounces[radau5-fixed-0.001-None-text0-thrown]",
        "test_no_number_is_read_before_it_is_written",
        "test_loops_near_a_dead_centre_come_nearer_with_shorter_steps", "test_a_ball_that_bounces[radau5-fixed-0.001-None-text1-sprung]",
        "test_a_ball_that_bounces[radau5-0.01-1e-09-text0-thrown]", "test_loops_at_a_force_that_jumps[radau5-fixed]",
    ),
    "tests/standalone/test_inputs_over_time.py": (
        "test_held_values_are_those_of_a_host[rk4]",
        "test_states_and_controllers[*rk4]",
        "test_coupled_stages[held-radau5-fixed]", "test_events_that_move[rk4]",
    ),
    "tests/view/test_drive.py": ("test_a_lap_of_a_car_replays_bit_by_bit",),
    "tests/analysis/test_kinematics.py": ("test_the_command_draws_a_picture_of_each_sweep",),
    "tests/analysis/test_linearisation.py": (
        "test_trees_in_motion",
    ),
    "tests/bench/test_reductions.py": (
        "test_models_that_a_scene_does_not_have",
        "test_lines_are_named_by_reduced_model",
    ),
    "tests/bench/test_killed.py": ("test_processes_end_with_a_killed_bench",),
    "tests/bench/test_prebuild.py": ("test_what_fails_is_left_to_the_bench",),
    "tests/coupling/test_with.py": (
        "test_several_fmus_step_side_by_side_as_by_hand",
        "test_what_nothing_drives_follows_the_scene_and_is_named",
        "test_two_models_step_side_by_side_as_by_hand",
        "test_a_controller_steers_a_guide_as_a_law_does",
        "test_the_controller_of_the_examples_balances_the_pole_as_equations_by_hand_say",
    ),
    "tests/coupling/test_misbehaving.py": (
        "test_what_changes_no_value_leaves_the_table_whole", "test_what_it_does_is_reported_and_rows_are_kept[DoStep-4-loop-*]",
    ),
    "tests/fmu/test_exchange.py": (
        "test_states_and_parameters_are_values_too[2]",
        "test_states_are_chosen_anew_as_a_ball_turns_and_the_motion_stays",
        "test_wrong_calls", "test_cvode_finds_contacts_and_leaves_them",
        "test_a_force_that_was_left_out_and_would_act_ends_the_simulation_as_it_ends_a_step",
    ),
    "tests/fmu/test_samples.py": (
        "test_a_host_that_integrates_meets_the_discrete_pole",
        "test_communication_steps_have_the_samples_within_and_saved_states_go_on_bit_by_bit",
    ),
    "tests/fmu/test_platforms.py": (
        "test_arm_has_the_numbers_of_this_machine",
        "test_a_dll_shows_the_standards_functions_alone_and_needs_windows_alone",
    ),
    "tests/fmu/test_targets.py": (
        "test_codes_differ_by_rounding",
        "test_a_processor_without_avx2_runs_the_code_for_all_bit_by_bit",
    ),
    "tests/fmu/test_wrong_calls.py": ("test_calls_out_of_order",),
    "tests/packaging/test_wheel.py": ("test_the_installed_wheel_of_measuring_adds_its_command",),
    "tests/packaging/test_sdist.py": ("test_the_source_distribution_has_what_its_tests_read",),
    "tests/pages/test_snippets.py": ("test_a_page_does_what_it_says",),
    "tests/physics/test_fitted_tyre.py": ("test_the_file_is_what_the_script_finds",),
    "tests/physics/test_held_poses.py": (
        "test_a_host_is_reported_where_a_scene_is_not_made_for_that", "test_simulations_of_a_host_begin_there",
    ),
    "tests/physics/test_iltis_driven.py": (
        "test_the_lane_is_changed", "test_a_sine_with_dwell_is_measured_in_what_0_3_g_takes", "test_stability_control_ends_the_turn",
        "test_the_anti_lock_brake_stops_shorter_and_straight", "test_a_start_uphill", "test_gears_are_changed",
        "test_a_step_of_the_steering_wheel_turns_the_car", "test_a_road_that_winds_is_followed",
    ),
    "tests/physics/test_iltis_scenes.py": (
        "test_simul1_peak_acceleration_is_that_of_the_converged_motion", "test_ten_kilometres_away_the_run_is_the_same",
        "test_simul1s_needs_the_papers_smaller_step", "test_simul3_turns_as_hard_as_the_paper_says",
        "test_mirrored_bumps_roll_the_car_the_other_way",
    ),
    "tests/physics/test_lagrangian.py": (
        "test_residuals_are_reported_for_each_step[augmented]",
        "test_every_scene", "test_errors_of_the_scene_as_it_stands",
    ),
    "tests/physics/test_proximal.py": (
        "test_a_penalty_is_an_upper_bound[iltis-*]",
        "test_forty_windows_pass_as_one_does",
    ),
    "tests/physics/test_signals.py": ("test_hosts_of_fmus",),
    "tests/physics/test_two_track.py": (
        "test_a_car_on_stiff_tyres_is_the_rigid_one[braking*", "test_a_car_on_stiff_tyres_is_the_rigid_one[sine*",
    ),
    "tests/physics/test_verification.py": ("test_the_benchmark_has_a_line_for_every_problem",),
    "tests/reduce/test_choose.py": (
        "test_an_impossible_accuracy_says_what_came_nearest", "test_the_chain_keeps_its_tolerance_across_its_singular_pose",
    ),
    "tests/run/test_batch_files.py": ("test_a_batch_on_a_full_disk_keeps_what_was_done",),
    "tests/runtime/test_dense.py": ("test_least_squares",),
    "tests/runtime/test_no_allocation.py": ("test_steps_in_parts_do_not_allocate", "test_steps_of_the_vehicle_do_not_allocate"),
    "tests/standalone/test_derivatives.py": (
        "test_the_code_calls_mathematics_and_nothing_else",
        "test_what_cannot_be_linearised_is_reported", "test_a_wheel_on_a_road", "test_a_ball_that_has_turned_far_is_ill_conditioned",
        "test_a_pendulum_that_swings", "test_laws_have_the_derivatives_of_sympy",
        "test_where_functions_are_infinitely_steep_what_stays_has_no_derivative", "test_a_cart_with_a_pole[recursive-newton]",
    ),
    "tests/standalone/test_dop853.py": ("test_hosts_have_one_table",),
    "tests/standalone/test_c_export.py": (
        "test_a_folder_goes_without_vector_mathematics", "test_random_calls_under_sanitizers", "test_a_project_takes_it_in_both_ways",
    ),
    "tests/standalone/test_impacts.py": (
        "test_a_cart_takes_its_rod_along[0.2037-augmented-*]",
        "test_a_snapshot_before_a_jump_and_one_behind_it_go_on_alike[augmented-*]",
        "test_an_event_of_an_fmu_is_the_impact", "test_a_sweep_has_the_rows_of_single_runs",
        "test_a_loaded_simulation_tells_of_the_event", "test_an_fmu_has_the_rows_of_a_run",
    ),
    "tests/standalone/test_integrators.py": (
        "test_what_an_integrator_has_not_is_refused", "test_inputs_and_parameters_count_from_the_next_step_on",
        "test_the_code_calls_mathematics_and_nothing_else",
    ),
    "tests/standalone/test_other_processors.py": ("test_a_run_has_the_numbers_of_this_machine",),
    "tests/standalone/test_steering.py": (
        "test_a_ramp_to_where_the_loop_cannot_close_tears_it[recursive-newton-*]",
        "test_a_jump_is_made_in_two_steps_without_going_beyond[recursive-newton-*]",
        "test_simulations_in_lanes_follow_as_one_alone", "test_a_law_that_is_held_step_by_step_is_followed[recursive-newton-*]",
    ),
    "tests/sweeps/test_as_simulated.py": ("test_an_fmu_has_them_too",),
    "tests/sweeps/test_lanes.py": (
        "test_roads_and_inputs", "test_laws_that_end_in_no_number", "test_workers_do_not_matter_and_the_table_says_that_there_are_lanes",
        "test_a_run_that_fails_leaves_the_others_alone", "test_other_ways_to_run_have_no_lanes",
    ),
    "tests/sweeps/test_masses.py": ("test_impossible_runs_are_rows_with_the_reason", "test_possible_runs_are_those_without_the_others"),
    "tests/sweeps/test_sweep.py": (
        "test_integrators_and_methods[*augmented*]",
        "test_a_call_that_was_stopped_goes_on[9]", "test_a_call_that_was_stopped_goes_on[2]",
        "test_attitudes_that_follow_from_parameters", "test_chunks_have_work_enough",
        "test_scenes_and_starts_that_follow_from_parameters", "test_a_damaged_part_is_made_anew",
    ),
    "tests/test_cli.py": (
        "test_a_parameter_is_changed_without_compiling", "test_compile_leaves_source_and_a_simulator",
        "test_a_run_that_fails_leaves_its_rows_and_says_where",
    ),
    "tests/test_examples.py": ("test_the_axles_of_the_study",),
    "tests/test_prepared.py": ("test_what_came_to_harm_is_prepared_anew",),
    "tests/test_same_code.py": ("test_more_operations_are_no_other_wording", "test_a_change_is_found_and_shown"),
    "tests/topology/test_operations.py": ("test_random_models",),
    "tests/fuzz/test_models.py": ("test_any_model", "test_odd_names_compile"),
    "tests/compile_run/test_projection.py": ("test_gaps_are_closed",),
    "tests/toolchain/test_flags.py": ("test_flags_are_checked_once_and_usual_ones_never",),
    "tests/toolchain/test_locks.py": (
        "test_one_of_two_processes_compiles", "test_a_process_that_was_killed_holds_up_nobody",
        "test_the_parts_of_the_driver_are_compiled_once_for_two_simulators",
    ),
    "tests/toolchain/test_objects.py": (
        "test_libraries_compile_no_dynamics_again", "test_a_library_shows_names_of_its_model_alone",
    ),
    "tests/toolchain/test_paths.py": ("test_a_cache_that_cannot_be_written_does_for_what_it_has",),
    "tests/view/test_sliders.py": ("test_a_vehicle_is_as_the_interpreter_says",),
    "tests/fuzz/test_kinds.py": ("test_corpus[steps_too_long_*]", "test_corpus[power_that_peaks_*]", "test_corpus[chain_that_falls_*]"),
    "tests/toolchain/test_compiler.py": ("test_variables_that_compilers_read_are_part_of_the_key",),
    "tests/standalone/test_simulation.py": ("test_rollout_in_lanes_of_what_is_linearised_too",),
    "tests/standalone/test_inputs.py": (
        "test_a_step_begins_with_the_acceleration_that_an_input_gives_as_it_jumps[classical-*]",
        "test_a_step_begins_with_the_acceleration_that_an_input_gives_as_it_jumps[augmented-single]",
        "test_a_step_begins_with_the_acceleration_that_an_input_gives_as_it_jumps[recursive-newton-coupled]",
        "test_a_step_begins_with_the_acceleration_that_an_input_gives_as_it_jumps[recursive-single]",
        "test_a_value_that_is_written_is_held_whatever_was_given_before[augmented]",
        "test_guides_take_rate_and_acceleration[augmented]",
    ),
    "tests/physics/test_states.py": (
        "test_a_simulation_that_a_host_holds_has_states[recursive]",
        "test_hosts_of_fmus_integrate_states", "test_a_simulation_that_a_host_holds_has_states[recursive-newton]",
    ),
    "tests/report/test_explain.py": ("test_the_same_bytes_under_any_hash_seed",),
    "tests/sweeps/test_cluster.py": ("test_a_worker_without_the_package", "test_a_worker_that_joins_late_has_its_share"),
    "tests/standalone/test_settings.py": ("test_expressions_of_the_step_follow_it[recursive-newton]",),
    "tests/view/test_damaged_pages.py": (
        "test_a_page_whose_script_cannot_say_it_has_the_notice[cut in its script]",
        "test_a_page_whose_script_cannot_say_it_has_the_notice[another script]",
    ),
    "tests/view/test_page.py": ("test_bodies_are_seen_where_the_table_says[iltis-*]",),
    "tests/model/test_problems.py": ("test_problems_without_end_are_cut_short",),
    "tests/physics/test_wheels.py": (
        "test_a_braked_wheel_is_pushed_off_at_the_limit_of_friction[52]",
        "test_a_wheel_in_the_mirror_is_the_image[]",
        "test_all_methods_brake_alike",
    ),
    "tests/physics/test_four_bar.py": ("test_rk4_keeps_its_order_through_singular_poses[40-10.0-True]",),
    "tests/view/test_graph.py": ("test_every_element_is_there_once[iltis_driven]", "test_bodies_do_not_cover_each_other[iltis_driven]"),
    "tests/view/test_meshes.py": ("test_refusals[a.glb-many*",),
    "tests/model/test_tunable.py": ("test_a_tunable_model_with_the_numbers_of_the_file_is_the_model[iltis_driven]",),
    "tests/compile_run/test_interpreted.py": ("test_models_as_their_programs_say[iltis_driven]",),
    "tests/fmu/test_archive.py": (
        "test_a_binary_shows_the_standards_functions_alone_and_needs_the_c_library_alone",
        "test_fmpy_compiles_the_sources",
    ),
    "tests/standalone/test_step_derivatives.py": (
        "test_methods_have_the_same_without_loops", "test_adaptive_steps_have_the_derivatives_of_the_motion[dop853]",
    ),
    "tests/standalone/test_run_derivatives.py": (
        "test_many_hardpoints_of_embedded_loops_side_by_side",
        "test_a_slope_that_is_no_number_beside_others",
        "test_states_and_controllers_that_take_samples[dormand-prince]",
        "test_states_and_controllers_that_take_samples[trapezoidal]",
        "test_a_loop_by_a_hardpoint[compiled]", "test_a_loop_by_a_hardpoint[embedded]", "test_a_slope_that_is_no_number_beside_others[rk4]",
        "test_loops_by_explicit_steps_near_a_dead_centre[rk4]",
    ),
    "tests/coupling/test_systems.py": ("test_ports_that_a_system_does_not_connect_stay",),
    "tests/analysis/test_modes.py": (
        "test_shimmy_of_a_caster[2.0-0.0]",
        "test_shimmy_of_a_caster[2.0-20.0]",
    ),
    "tests/compile_run/test_friction.py": (
        "test_an_fmu_has_the_bristle_as_a_state",
        "test_restored_moments_of_python_go_on_the_same[recursive]",
        "test_generated_code_of_a_loop_has_the_loads_of_the_interpreter[recursive-newton]",
    ),
    "tests/compile_run/test_supplied_functions.py": ("test_a_sweep_has_the_code_of_the_command_line",),
    "tests/fits/test_fit.py": ("test_an_experiment_from_the_drawn_pose_behind_one_at_rest",),
    "tests/fmu/test_events.py": (
        "test_steps_that_find_no_events_have_no_event_mode",
        "test_updates_come_after_each_step_of_the_integrator_and_at_events",
    ),
    "tests/fmu/test_poses.py": ("test_fmus_have_the_poses_of_the_interface",),
    "tests/fmu/test_steps.py": (
        "test_a_step_of_fixed_length_that_fails_at_its_end_leaves_the_instance_as_it_was[recursive-newton-2]",
        "test_a_step_of_fixed_length_that_fails_at_its_end_leaves_the_instance_as_it_was[recursive-3]",
    ),
    "tests/physics/test_starts.py": ("test_a_truck_and_trailer_at_20_m_s", "test_a_motorcycle_that_leans",),
    "tests/physics/test_hill_start.py": ("test_a_car_starts_uphill_from_its_rest_on_the_slope[1 ms]",),
    "tests/physics/test_start.py": ("test_given_coordinates_beside_assembled_places_keep_the_assembly_too",),
    "tests/physics/test_terrain.py": ("test_a_host_gives_it_before_each_step",),
    "tests/runtime/test_dual_lanes.py": ("test_slopes_are_those_of_differences[two]",),
    "tests/runtime/test_libm.py": ("test_its_values_are_near_to_exact_ones",),
    "tests/standalone/test_dynamics.py": (
        "test_a_cart_with_a_pole[recursive]",
        "test_bodies_move_and_weigh_as_their_jacobians_say[flyball-100]",
    ),
    "tests/standalone/test_external_wrenches.py": ("test_an_external_wrench_is_the_load_that_a_model_file_names",),
    "tests/standalone/test_frequency_response.py": ("test_a_half_car_on_two_posts_responds_as_its_matrices_say",),
    "tests/standalone/test_load_derivatives.py": ("test_derivatives_by_a_mass_over_a_load_that_passes_zero[*back*]",),
    "tests/standalone/test_moved_bases.py": ("test_a_shaken_table_moves_its_load_as_the_closed_form_says[ground]",),
    "tests/compile_run/test_loops.py": ("test_loops_compile[conditions, natural]",),
    "tests/standalone/test_newton_derivatives.py": (
        "test_balls_in_a_loop[generalised-alpha]",
    ),
    "tests/standalone/test_start_derivatives.py": (
        "test_an_eigenvalue_that_repeats_has_none",
    ),
    "tests/standalone/test_run_adjoints.py": (
        "test_chains_states_and_controllers[text2-*]", "test_chains_states_and_controllers[text3-*]",
        "test_loops[rk4]",
    ),
    "tests/formulate/test_implicit.py": (
        "test_tangent_with_gears[0-True]",
    ),
    "tests/formulate/test_natural.py": (
        "test_geared_tree[0-False]",
    ),
    "tests/sweeps/test_page.py": (
        "test_runs_that_began_and_failed_have_replays",
    ),
}  # fmt: skip

#: By file and test, or "*" for all others of the file, patterns of the cases that stay.
_KEPT: Mapping[str, Mapping[str, tuple[str, ...]]] = {
    "tests/compile_run/test_generated.py": {
        "test_generated_code_equals_the_interpreter": ("four_bar-swing-g++", "iltis-simul1s-g++"),
        "test_long_functions_are_compiled_in_parts": ("g++",),
        "test_every_joint_kind_compiles_and_equals_the_interpreter": ("universal",),
        "test_loops_equal_the_interpreter": ("balls-g++",),
    },
    "tests/compile_run/test_interpreted.py": {"test_systems_as_their_programs_say": ("slider_crank-*", "car-recursive-newton")},
    "tests/compile_run/test_loops.py": {"test_loops_compile": ("balls", "conditions, natural", "numbers, batch")},
    "tests/coupling/test_misbehaving.py": {
        "test_what_it_does_is_reported_and_rows_are_kept": ("GetReal-*", "DoStep-4-loop-*"),
        "test_what_changes_no_value_leaves_the_table_whole": ("DoStep-flood",),
    },
    "tests/coupling/test_with.py": {
        "test_two_models_step_side_by_side_as_by_hand": ("3",), "test_a_controller_steers_a_guide_as_a_law_does": ("0.002",),
    },
    "tests/emit/test_names.py": {"test_a_model_may_be_called_as_what_the_runtime_has": ("weights-augmented",)},
    "tests/emit/test_source.py": {"test_same_bytes_under_any_hash_seed": ("iltis-*",)},
    "tests/fmu/test_archive.py": {
        "test_fmpy_has_the_table_of_the_command_line_bit_by_bit": ("press-None-3",),
        "test_the_layer_compiles_without_warnings_and_takes_a_prefix": ("cs-g++-2", "me-g++-3", "both-clang++-3"),
        "test_a_binary_shows_the_standards_functions_alone_and_needs_the_c_library_alone": ("3",),
    },
    "tests/fmu/test_events.py": {"test_inputs_jump_in_event_mode": ("rk4",), "test_wrong_calls": ("cs",)},
    "tests/fmu/test_exchange.py": {
        "test_cvode_has_the_motion_of_the_command_line": ("press-2",),
        "test_what_changes_depends_on_what_was_changed": ("spinning", "driven"),
        "test_indicators_change_their_sign_at_contact": ("2",),
        "test_states_are_chosen_anew_as_a_ball_turns_and_the_motion_stays": ("3",),
        "test_directional_derivatives_are_those_of_a_closed_form": ("2",),
        "test_co_simulation_beside_model_exchange_is_that_alone": ("2",),
        "test_states_that_loops_cannot_reach_are_discarded_and_leave_the_instance": ("3",),
        "test_saved_states_go_on_bit_by_bit": ("3",),
        "test_a_force_that_was_left_out_and_would_act_ends_the_simulation_as_it_ends_a_step": ("3",),
    },
    "tests/fmu/test_steps.py": {
        "test_steps_by_newtons_iteration_are_those_of_the_interface": ("3-augmented-trapezoidal",),
        "test_inputs_begin_with_the_scenes_value_and_are_held": ("3",),
        "test_outputs_stay_until_the_next_step": ("None-3",),
        "test_outputs_that_change_at_the_start_depend_on_what_was_set": ("*-3",),
        **dict.fromkeys((
            "test_states_go_on_bit_by_bit_in_any_instance", "test_states_before_the_start_return_there",
            "test_instances_are_independent_and_reset",
        ), ("3",)),
    },
    "tests/formulate/test_implicit.py": {
        "test_tangent_of_loops": ("*-roots", "point_on_line-*"), "test_tangent_of_random_loops": ("[02]",),
        "test_tangent_of_random_trees": ("[02]",), "test_tangent_with_gears": ("0-*",), "test_tangent_with_contacts": ("0",),
        "test_tangent_with_ball_springs": ("0",),
        "test_tangent_of_trees": ("*universal*", "*screw*"),
    },
    "tests/analysis/test_assembled.py": {"test_random_mechanisms_move_as_by_their_loops_equations": ("0-*", "1-*")},
    "tests/edges/test_commands.py": {
        "test_bad_values": ("simulate-*", "batch-*", "export-*", "modes-*", "equilibrium-*", "check-*", "explain-*", "view-*", "sweep-*"),
    },
    "tests/formulate/test_against_dense.py": {
        "test_cut_joint": ("*-branch", "*-roots", "*-base_outside", "*-parent"), "test_tree_joint": ("*-0", "*-normal-*"),
    },
    "tests/formulate/test_cut_coordinates.py": {
        **dict.fromkeys(("test_tangents_have_them", "test_rates_are_those_of_the_positions"), ("screw-*", "planar-*")),
    },
    "tests/formulate/test_energy.py": {"test_trees": ("universal", "spherical"), "test_loops": ("[03]",), "test_guided_joints": ("screw",)},
    "tests/formulate/test_reactions.py": {"test_tree_joints_in_natural_coordinates": ("*universal*",)},
    "tests/formulate/test_reports.py": {"test_reaction_of_a_tree_joint": ("*universal*", "*spherical*")},
    "tests/formulate/test_signals.py": {
        "test_recursive_newton_has_the_exact_tangent": ("0-3",), "test_natural_coordinates_have_the_tangent_of_all_that_laws_read": ("1",),
        "test_the_classical_tangent_has_states": ("1",),
    },
    "tests/formulate/test_samples.py": {"test_samples_are_what_outputs_report": ("recursive-newton-0", "classical-1")},
    "tests/fuzz/test_kinds.py": {"test_some_seeds": ("calls", "parts", "lanes", "poses", "massless", "friction")},
    "tests/sparse/test_factorisation.py": {
        "test_indefinite_systems": ("1-straight",), "test_a_pivot_that_is_not_finite_is_reported": ("nan-straight",),
    },
    "tests/toolchain/test_paths.py": {"test_any_name_of_the_cache_and_of_folders": ("name0", "no *")},
    "tests/formulate/test_natural.py": {
        "test_cut_joint": ("universal-roots", "screw-roots", "point_on_line-*"),
        "test_tree_joint": ("universal-reversed", "screw-reversed"),
        "test_reaction_of_a_cut_joint": ("screw",), "test_coupled_loops": ("1",), "test_geared_tree": ("0",),
        "test_tangents": ("flyball-*", "*slider_crank*"), "test_model": ("*slider_crank*", "*flyball*"),
        "test_tangents_of_random_models": ("1",),
    },
    "tests/packaging/test_bare.py": {
        "test_other_commands": ("*check*", "*plots---view"),
        "test_runs_are_those_of_generated_code": ("*-recursive-newton-radau5", "*-recursive-trapezoidal"),
    },
    "tests/physics/test_gears.py": {"test_trapezoidal_rule": ("*recursive", "recursive*")},
    "tests/physics/test_impacts.py": {"test_random_mechanisms_are_struck_as_by_dense_algebra": ("tree0", "loops4", "loops10")},
    "tests/physics/test_lagrangian.py": {
        "test_every_scene": ("simul1-classical",), "test_errors_of_the_scene_as_it_stands": ("A0[123]-*", "A05-classical", "SC3D-*"),
    },
    "tests/physics/test_massless_middles.py": {
        "test_every_method_moves_a_massless_body_as_one_of_hardly_any_mass": ("revolute crossing A", "universal *"),
    },
    "tests/physics/test_proximal.py": {
        **dict.fromkeys((
            "test_constraints_hold_at_any_penalty", "test_a_penalty_is_an_upper_bound",
        ), ("four_bar-*", "slider_crank-*", "andrews-*", "iltis-simul1-*")),
        "test_forty_windows_pass_as_one_does": ("0.001",),
    },
    "tests/physics/test_signals.py": {
        "test_methods_and_integrators": ("motor-*-trapezoidal", "carts-*-dormand-prince", "carts-*-radau5"),
        "test_generated_code_has_the_motion_of_the_interpreter": ("recursive", "augmented"),
        "test_a_simulation_that_a_host_holds": ("recursive",),
    },
    "tests/runtime/test_no_allocation.py": {"test_steps_of_the_vehicle_do_not_allocate": ("recursive-proximal-*",)},
    "tests/standalone/test_derivatives.py": {
        "test_derivatives_are_those_of_differences_in_113_bits": ("driven-*",),
        "test_the_code_calls_mathematics_and_nothing_else": ("flyball-recursive-clang++",),
        "test_at_rest_eigenvalues_are_those_of_the_modes": ("recursive",),
    },
    "tests/standalone/test_c_export.py": {
        "test_the_code_calls_mathematics_and_nothing_else": ("clang++-press-None-augmented",),
        "test_calls_right_and_wrong": ("recursive",),
        "test_its_table_is_that_of_the_command_line_bit_by_bit": ("press-None-recursive-newton",),
        "test_a_force_that_was_left_out_and_would_act_ends_the_motion": ("recursive-newton",),
        "test_any_name_will_do": ("main",),
    },
    "tests/standalone/test_impacts.py": {
        "test_steps_are_those_of_the_command_line": tuple(f"cart-0.2037-{rule[1:]}" for rule in _IMPACTS[1:2]),
        "test_a_cart_takes_its_rod_along": tuple(f"0.2037-{rule[1:]}" for rule in _IMPACTS),
        "test_a_loop_is_struck_as_by_dense_algebra": _IMPACTS[1:2],
        "test_the_code_takes_no_memory": _IMPACTS[1:2],
        "test_a_snapshot_before_a_jump_and_one_behind_it_go_on_alike": _IMPACTS,
        "test_a_host_goes_back_behind_a_jump": _IMPACTS,
        "test_an_fmu_has_the_rows_of_a_run": ("recursive-trapezoidal-crossed-3",),
    },
    "tests/standalone/test_inputs.py": {
        **dict.fromkeys((
            "test_inputs_that_nobody_sets_follow_the_scene", "test_steps_keep_their_order_where_a_host_makes_an_input_jump",
            "test_a_host_that_sets_the_laws_of_the_scene_has_its_motion", "test_simulations_in_lanes_have_inputs_of_their_own",
        ), ("recursive",)),
        **dict.fromkeys((
            "test_guides_take_rate_and_acceleration", "test_a_value_that_is_written_is_held_whatever_was_given_before",
            "test_values_written_into_the_array_are_held",
        ), _METHODS),
    },
    "tests/standalone/test_integrators.py": {
        "test_equal_steps_are_those_of_the_command_line_bit_by_bit": ("press-0.002-*",),
        "test_steps_end_at_events": _EVENTS[:1], "test_a_tolerance_is_kept": ("recursive-newton-*",),
        "test_restored_moments_go_on_the_same": _EVENTS,
        "test_who_looks_on_changes_nothing": _EVENTS,
        "test_a_time_that_rounding_parts_from_the_end_of_a_step_is_reached": ("recursive-newton-*",),
    },
    "tests/standalone/test_settings.py": {"*": ("recursive", "recursive-newton")},
    "tests/standalone/test_simulation.py": {"*": ("recursive", "augmented", "recursive-newton")},
    "tests/standalone/test_steering.py": {
        **dict.fromkeys((
            "test_a_law_that_is_held_step_by_step_is_followed", "test_a_jump_is_made_in_two_steps_without_going_beyond",
            "test_a_ramp_to_where_the_loop_cannot_close_tears_it", "test_a_jump_in_short_steps_ends_where_it_was_to_end",
        ), _WAYS),
        **dict.fromkeys(("test_another_fault_blames_no_loop", "test_a_reset_forgets_derivatives"), ("recursive",)),
    },
    "tests/sweeps/test_as_simulated.py": {"*": ("stopped",), "test_an_fmu_has_them_too": ("3-stopped",), "test_what_decides": ("*",)},
    "tests/sweeps/test_lanes.py": {"test_runs_of_a_press": ("proximal",), "test_other_ways_to_run_have_no_lanes": ("*rk4*",)},
    "tests/sweeps/test_sweep.py": {
        "test_a_call_that_was_stopped_goes_on": ("9",), "test_chunks_have_work_enough": ("2-1000-100",),
    },
    "tests/toolchain/test_damage.py": {
        "test_two_processes_that_meet_a_damaged_simulator": ("a bit flipped", "a folder"),
        "test_a_damaged_part_of_the_driver_is_built_again": ("a bit flipped",),
    },
    "tests/toolchain/test_flags.py": {
        "test_what_makes_no_program_is_named": ("no option", "no quote", "no exceptions", "syntax", "preprocessed", "not run"),
        "test_what_makes_no_library_is_named_where_one_is_made": ("-fpie",),
        "test_others_are_taken": ("-DX='a b'",),
    },
    "tests/toolchain/test_objects.py": {"test_what_is_not_of_the_dynamics_does_not_compile_them_again": ("an output",)},
    "tests/toolchain/test_warm.py": {"test_a_damaged_driver_is_built_again": ("a bit flipped", "a folder")},
    "tests/view/test_every_view.py": {"test_models": ("*-four_bar", "*-gantry", "*-leg", "*-flyball")},
    "tests/view/test_view_command.py": {"test_natural_coordinates_show_the_same": ("augmented-hung", "classical-crane")},
}  # fmt: skip


def left_out(names: Iterable[str]) -> set[str]:
    """The node ids among ``names`` that are for `make full` only: those of `_FULL`, and others but never all cases of a test."""
    cases: dict[str, list[str]] = {}
    for name in names:
        cases.setdefault(name.partition("[")[0], []).append(name)
    found: set[str] = set()
    for test, given in cases.items():
        file, _, function = test.rpartition("::")
        whole = [pattern for pattern in _FULL.get(file, ()) if pattern.partition("[")[0] == function]
        if function in whole:
            found.update(given)
            continue
        cases_left = [pattern.partition("[")[2].rstrip("]") for pattern in whole]
        found.update(name for name in given if any(fnmatchcase(name.partition("[")[2][:-1], pattern) for pattern in cases_left))
        kept = _KEPT.get(file, {})
        patterns = kept.get(function, kept.get("*"))
        if patterns is None:
            continue
        others = [name for name in given if not any(fnmatchcase(name.partition("[")[2][:-1], pattern) for pattern in patterns)]
        if len(others) < len(given):
            found.update(others)
    return found
