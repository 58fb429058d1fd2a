"""Tests of files, runs, sweeps, FMUs, tools and the like: those for `make full` alone, and the cases that stay in `make test`."""

from __future__ import annotations

from collections.abc import Mapping

FULL: Mapping[str, tuple[str, ...]] = {
    "tests/bench/test_atlas.py": (
        "test_recursive_crosses_with_a_heavy_penalty", "test_a_long_chain_needs_more_corrections_of_its_multipliers",
        "test_a_step_that_ends_on_the_pose", "test_all_methods_cross", "test_classical_is_tried_once_for_all_penalties",
        "test_what_is_in_the_store_is_not_run_again", "test_words_count_the_outcomes",
        "test_chart_is_the_same_every_time_and_has_every_outcome",
    ),
    "tests/bench/test_explorer.py": ("test_points_without_an_error_are_left_out",),
    "tests/bench/test_fixed_point.py": ("*",),  # a driver of its own
    "tests/bench/test_killed.py": ("test_processes_end_with_a_killed_bench",),
    "tests/bench/test_prebuild.py": ("test_what_fails_is_left_to_the_bench",),
    "tests/bench/test_reductions.py": ("test_models_that_a_scene_does_not_have", "test_lines_are_named_by_reduced_model"),
    "tests/bench/test_waits.py": ("test_phases_make_what_the_pipeline_generates",),
    "tests/compile_run/test_friction.py": (
        "test_an_fmu_has_the_bristle_as_a_state", "test_generated_code_of_a_loop_has_the_loads_of_the_interpreter[recursive-newton]",
        "test_restored_moments_of_python_go_on_the_same", "test_batches_and_studies",
    ),
    "tests/compile_run/test_function_memory.py": ("test_a_memory_moves_as_numbers_that_a_controller_keeps",),
    "tests/compile_run/test_generated.py": ("test_loops_equal_the_interpreter", "test_generated_code_equals_the_interpreter"),
    "tests/compile_run/test_interpreted.py": (
        "test_the_same_input_gives_the_same_bytes", "test_systems_as_their_programs_say", "test_models_as_their_programs_say",
        "test_all_kinds_as_their_programs_say",
    ),
    "tests/compile_run/test_loops.py": ("test_loops_compile[conditions, natural]",),
    "tests/compile_run/test_projection.py": ("test_gaps_are_closed",),
    "tests/compile_run/test_supplied_functions.py": (
        "test_a_sweep_has_the_code_of_the_command_line", "test_templates_move_as_the_expression_does",
    ),
    "tests/coupling/test_misbehaving.py": (
        "test_what_changes_no_value_leaves_the_table_whole", "test_what_it_does_is_reported_and_rows_are_kept",
    ),
    "tests/coupling/test_systems.py": ("test_ports_that_a_system_does_not_connect_stay",),
    "tests/coupling/test_with.py": (
        "test_several_fmus_step_side_by_side_as_by_hand", "test_what_nothing_drives_follows_the_scene_and_is_named",
        "test_two_models_step_side_by_side_as_by_hand", "test_a_controller_steers_a_guide_as_a_law_does",
        "test_the_controller_of_the_examples_balances_the_pole_as_equations_by_hand_say",
        "test_inputs_that_jump_leave_the_trapezoidal_rule_its_order",
    ),
    "tests/export/test_pinocchio.py": ("test_hinges_of_a_planar_loop_are_held_in_one_point",),
    "tests/fits/test_fit.py": (
        "test_an_experiment_from_the_drawn_pose_behind_one_at_rest", "test_numbers_that_data_cannot_tell_apart_are_named",
        "test_coloured_residuals_are_a_verdict", "test_a_driven_arm_from_rest_with_ties_starts_and_bootstrap",
        "test_an_experiment_without_input_follows_its_scene_behind_one_that_is_driven",
    ),
    "tests/fmu/test_archive.py": (
        "test_a_binary_shows_the_standards_functions_alone_and_needs_the_c_library_alone", "test_fmpy_compiles_the_sources",
        "test_an_archive_follows_from_the_model_alone", "test_the_page_shows_all_variables",
    ),
    "tests/fmu/test_events.py": (
        "test_steps_that_find_no_events_have_no_event_mode", "test_updates_come_after_each_step_of_the_integrator_and_at_events",
        "test_steps_end_where_an_update_wants_it", "test_steps_end_at_events_and_the_motion_stays",
    ),
    "tests/fmu/test_exchange.py": (
        "test_states_are_chosen_anew_as_a_ball_turns_and_the_motion_stays", "test_wrong_calls",
        "test_cvode_finds_contacts_and_leaves_them",
        "test_a_force_that_was_left_out_and_would_act_ends_the_simulation_as_it_ends_a_step",
        "test_inputs_that_move_guides_have_their_rates",
        "test_derivatives_with_loops_are_limits_of_differences",
        "test_derivatives_by_parameters_are_those_of_motions_that_are_linear_in_them",
        "test_loops_of_a_hundred_metres_follow_states_in_one_go", "test_states_and_parameters_are_values_too",
        "test_indicators_change_their_sign_at_contact",
    ),
    "tests/fmu/test_platforms.py": (
        "test_arm_has_the_numbers_of_this_machine", "test_a_dll_shows_the_standards_functions_alone_and_needs_windows_alone",
    ),
    "tests/fmu/test_poses.py": ("test_fmus_have_the_poses_of_the_interface",),
    "tests/fmu/test_samples.py": (
        "test_a_host_that_integrates_meets_the_discrete_pole",
        "test_communication_steps_have_the_samples_within_and_saved_states_go_on_bit_by_bit",
    ),
    "tests/fmu/test_scene_method.py": ("test_commands_take_the_scenes_method_where_it_has_what_they_write[options1]",),
    "tests/fmu/test_steps.py": (
        "test_steps_by_newtons_iteration_are_those_of_the_interface", "test_parameters_start_and_step_are_the_hosts",
        "test_inputs_are_held_or_go_on_by_their_derivatives", "test_outputs_stay_until_the_next_step",
        "test_a_step_of_fixed_length_that_fails_at_its_end_leaves_the_instance_as_it_was",
        "test_inputs_begin_with_the_scenes_value_and_are_held",
    ),
    "tests/fmu/test_targets.py": (
        "test_codes_differ_by_rounding", "test_a_processor_without_avx2_runs_the_code_for_all_bit_by_bit",
        "test_states_go_on_in_the_other_code",
    ),
    "tests/fmu/test_wrong_calls.py": ("test_calls_out_of_order",),
    "tests/fuzz/test_command.py": ("test_a_signal_that_ends_the_fuzzing_reaches_no_input",),
    "tests/fuzz/test_expressions.py": ("test_garbage",),
    "tests/fuzz/test_kinds.py": (
        "test_corpus[steps_too_long_*]", "test_corpus[power_that_peaks_*]", "test_corpus[chain_that_falls_*]",
        "test_corpus[jump_in_half_a_step_then_seven*]", "test_corpus[load_friction_of_an_angle*]",
        "test_corpus[jump_in_half_a_step_after_a_reset*]", "test_corpus[guide_that_nothing_feels*]",
        "test_corpus[floating_loop_of_many_unknowns*]",
    ),
    "tests/fuzz/test_models.py": (
        "test_any_model", "test_odd_names_compile", "test_corpus[aim_in_a_flat_direction]",
        "test_corpus[cpp_names_that_instances_make_alike]", "test_corpus[cpp_model_[dlrs]*]",
    ),
    "tests/packaging/test_bare.py": (
        "test_the_second_run_is_found_in_the_cache", "test_batches_have_the_results_of_generated_code", "test_other_commands",
        "test_the_package_is_that_of_the_wheel", "test_a_simulation_that_a_host_holds_takes_generated_code",
    ),
    "tests/packaging/test_sdist.py": ("test_the_source_distribution_has_what_its_tests_read",),
    "tests/packaging/test_systems.py": ("test_what_systems_differ_in_stands_in_one_place",),
    "tests/packaging/test_wheel.py": ("test_the_installed_wheel_of_measuring_adds_its_command",),
    "tests/pages/test_snippets.py": ("test_a_page_does_what_it_says",),
    "tests/run/test_batch.py": (
        "test_the_closure_is_that_of_the_scene", "test_guards_stop_the_runs_whose_forces_would_act",
        "test_conditions_on_time_and_parameters", "test_a_law_without_a_value_is_named_as_in_a_single_run[proximal]",
    ),
    "tests/run/test_batch_files.py": ("test_a_batch_on_a_full_disk_keeps_what_was_done", "test_an_interrupted_batch_keeps_what_was_done"),
    "tests/run/test_binary_tables.py": ("test_a_full_disk_leaves_no_table",),
    "tests/run/test_events_option.py": ("test_a_scenes_events_are_not_meant_for_other_methods_and_generic_solvers[classical]",),
    "tests/run/test_fallbacks.py": (
        "test_a_guide_that_leads_a_loop_past_its_reach_is_named[recursive-newton]", "test_a_singular_pose_is_crossed[recursive-newton*]",
        "test_a_run_that_stands_still_is_reported_what_was_tried",
    ),
    "tests/run/test_files.py": (
        "test_no_file_of_a_folder_is_the_model[compile]", "test_a_file_system_that_is_full", "test_a_reader_that_goes_away_ends_the_run",
        "test_a_row_of_many_steps_ends_by_a_signal", "test_a_full_disk_is_noticed_wherever_it_is_full",
        "test_standard_output_takes_the_table_alone",
    ),
    "tests/run/test_inputs.py": (
        "test_tables_drive_a_run_as_the_laws_that_they_follow[recursive-newton-generated]",
        "test_tables_drive_a_run_as_the_laws_that_they_follow[classical-*]",
        "test_tables_drive_a_run_as_the_laws_that_they_follow[augmented-*]", "test_cases_of_a_batch_hold_inputs_each_their_own",
    ),
    "tests/run/test_plots.py": ("test_the_command_draws_them_when_compiled_and_from_the_cache", "test_a_model_names_its_display_units"),
    "tests/run/test_roads.py": ("test_a_wheel_that_only_rises_feels_its_road",),
    "tests/run/test_run_file.py": ("test_the_command_ends_with_the_place",),
    "tests/runtime/test_dense.py": ("test_least_squares", "test_eigenvalues"),
    "tests/runtime/test_domains.py": (
        "test_the_law_is_named[augmented*]", "test_the_law_is_named[classical*]", "test_runs_of_a_batch_name_the_law",
        "test_a_rate_or_a_signal_without_a_value_is_named",
    ),
    "tests/runtime/test_dual_lanes.py": ("test_slopes_are_those_of_differences",),
    "tests/runtime/test_explicit.py": ("test_runs_repeat_themselves_to_the_bit[iltis-*]",),
    "tests/runtime/test_fixed_point.py": ("test_two_masses[k1*]",),
    "tests/runtime/test_lagrangian.py": ("*",),
    "tests/runtime/test_lagrangian_driver.py": ("*",),
    "tests/runtime/test_lagrangian_failures.py": ("*",),
    "tests/runtime/test_last_row.py": ("*",),
    "tests/runtime/test_libm.py": ("test_its_values_are_near_to_exact_ones", "test_no_other_mathematics_is_called"),
    "tests/runtime/test_no_allocation.py": (
        "test_steps_in_parts_do_not_allocate", "test_steps_of_the_vehicle_do_not_allocate", "test_steps_do_not_allocate[augmented*]",
        "test_steps_do_not_allocate[classical*]",
    ),
    "tests/runtime/test_realtime.py": ("test_steps_up_to_a_failure_are_reported", "test_more_iterations_come_nearer"),
    "tests/sweeps/test_as_simulated.py": (
        "test_an_fmu_has_them_too", "test_a_loaded_model_has_them_too", "test_the_command_says_how_runs_step",
        "test_a_sweep_has_the_rows_of_single_runs",
    ),
    "tests/sweeps/test_cluster.py": (
        "test_a_worker_without_the_package", "test_a_worker_that_joins_late_has_its_share", "test_a_local_cluster_makes_the_same_file",
        "test_workers_that_cannot_run_the_library",
    ),
    "tests/sweeps/test_indices.py": (
        "test_points_of_runs_without_a_number_do_not_count", "test_the_command_prints_shares_the_largest_first",
        "test_the_optimiser_of_the_page_on_sweeps_finds_the_best_press",
    ),
    "tests/sweeps/test_lanes.py": (
        "test_roads_and_inputs", "test_laws_that_end_in_no_number", "test_workers_do_not_matter_and_the_table_says_that_there_are_lanes",
        "test_a_run_that_fails_leaves_the_others_alone", "test_other_ways_to_run_have_no_lanes",
        "test_rows_in_memory_are_those_of_all_lanes",
    ),
    "tests/sweeps/test_masses.py": ("test_impossible_runs_are_rows_with_the_reason", "test_possible_runs_are_those_without_the_others"),
    "tests/sweeps/test_page.py": (
        "test_runs_that_began_and_failed_have_replays", "test_a_page_of_many_runs_keeps_the_extremes",
        "test_the_ends_are_one_click_from_their_replays", "test_the_page_shows_the_table",
    ),
    "tests/sweeps/test_signals.py": ("test_studies",),
    "tests/sweeps/test_sweep.py": (
        "test_a_call_that_was_stopped_goes_on[9]", "test_a_call_that_was_stopped_goes_on[2]",
        "test_attitudes_that_follow_from_parameters", "test_chunks_have_work_enough",
        "test_scenes_and_starts_that_follow_from_parameters", "test_a_damaged_part_is_made_anew", "test_integrators_and_methods",
        "test_rows_of_another_study_are_refused", "test_failures_are_reported_by_their_reasons", "test_every_function_of_expressions",
        "test_a_run_that_fails_is_a_row",
    ),
    "tests/sweeps/test_tasks.py": ("test_response",),
    "tests/test_cli.py": (
        "test_a_parameter_is_changed_without_compiling", "test_compile_leaves_source_and_a_simulator",
        "test_a_run_that_fails_leaves_its_rows_and_says_where", "test_equilibrium_prints_every_force",
    ),
    "tests/test_examples.py": (
        "test_the_axles_of_the_study", "test_the_vehicle_follows_its_driver_also_from_another_process",
        "test_computed_torque_moves_a_closed_loop_as_wanted", "test_the_pole_swings_up", "test_stiffer_springs_move_the_slider_less",
        "test_a_spring_and_a_point_are_found_from_a_motion", "test_a_crane_stops_without_a_swing", "test_the_pole_stands",
    ),
    "tests/test_first_answer.py": (
        "test_compiled_code_that_is_there_first_takes_over", "test_who_asks_for_generated_code_waits_for_it",
        "test_scripts_wait_for_generated_code",
    ),
    "tests/test_prepared.py": (
        "test_what_came_to_harm_is_prepared_anew", "test_a_run_needs_no_cache_to_write_to",
        "test_a_run_that_is_compiled_imports_nothing_of_other_commands", "test_another_file_of_the_model_is_prepared_anew",
    ),
    "tests/test_python.py": ("test_a_repr_fits_a_screen",),
    "tests/test_reported.py": ("test_our_models_use_their_parameters_and_the_words_of_this_version[iltis_driven]",),
    "tests/test_same_code.py": ("test_more_operations_are_no_other_wording", "test_a_change_is_found_and_shown"),
    "tests/toolchain/test_compile_progress.py": ("test_a_damaged_record_is_none",),
    "tests/toolchain/test_compiler.py": (
        "test_variables_that_compilers_read_are_part_of_the_key", "test_flags_and_launchers_are_part_of_the_compiler",
    ),
    "tests/toolchain/test_damage.py": ("test_two_processes_that_meet_a_damaged_simulator",),
    "tests/toolchain/test_flags.py": (
        "test_flags_are_checked_once_and_usual_ones_never", "test_what_makes_no_library_is_named_where_one_is_made",
        "test_others_are_taken",
    ),
    "tests/toolchain/test_hostile_folders.py": ("test_the_command_imports_nothing_from_the_present_folder",),
    "tests/toolchain/test_locks.py": (
        "test_one_of_two_processes_compiles", "test_a_process_that_was_killed_holds_up_nobody",
        "test_the_parts_of_the_driver_are_compiled_once_for_two_simulators",
    ),
    "tests/toolchain/test_objects.py": (
        "test_libraries_compile_no_dynamics_again", "test_a_library_shows_names_of_its_model_alone",
        "test_a_simulator_is_made_of_the_object_files_that_there_are", "test_what_is_of_the_dynamics_compiles_them_again",
    ),
    "tests/toolchain/test_paths.py": ("test_a_cache_that_cannot_be_written_does_for_what_it_has",),
    "tests/toolchain/test_processor.py": ("test_flags_that_name_no_processor_are_the_same_everywhere",),
    "tests/toolchain/test_warm.py": (
        "test_drivers_of_several_flags_and_kinds_stand_side_by_side", "test_a_driver_that_is_damaged_everywhere_is_built_again",
        "test_drivers_of_another_version_are_removed", "test_an_installation_that_cannot_be_written",
        "test_a_damaged_driver_is_built_again",
    ),
    "tests/view/test_arrows.py": ("test_arrows_are_shown_on_request",),
    "tests/view/test_damaged_pages.py": (
        "test_a_page_whose_script_cannot_say_it_has_the_notice[cut in its script]",
        "test_a_page_whose_script_cannot_say_it_has_the_notice[another script]",
    ),
    "tests/view/test_drive.py": ("test_a_lap_of_a_car_replays_bit_by_bit",),
    "tests/view/test_glb.py": ("test_what_is_not_sound_is_named[content21-*]", "test_parts_that_stand_often_are_made_one_by_one"),
    "tests/view/test_gltf.py": (
        "test_keyframes_are_where_the_table_says[iltis-*]", "test_the_validator_has_nothing_to_say[iltis]",
        "test_the_validator_takes_motions", "test_the_page_of_ten_seconds_is_below_five_megabytes",
    ),
    "tests/view/test_graph.py": ("test_every_element_is_there_once[iltis_driven]", "test_bodies_do_not_cover_each_other[iltis_driven]"),
    "tests/view/test_live.py": ("test_the_command_says_where_it_is_seen", "test_files_and_hosts_are_apart"),
    "tests/view/test_meshes.py": ("test_refusals[a.glb-many*",),
    "tests/view/test_motions.py": ("test_a_page_has_its_ending[check]",),
    "tests/view/test_new_force.py": ("test_a_line_is_a_spring_between_its_points",),
    "tests/view/test_over.py": ("test_a_ghost_shows_columns_in_the_units_of_the_page_alone", "test_both_runs_are_where_their_tables_say"),
    "tests/view/test_page.py": ("test_bodies_are_seen_where_the_table_says[iltis-*]", "test_all_of_it_is_seen_from_the_start"),
    "tests/view/test_sliders.py": ("test_a_vehicle_is_as_the_interpreter_says", "test_operations_are_printed_as_they_are_interpreted"),
    "tests/view/test_view_command.py": (
        "test_what_method_auto_has_run_is_seen", "test_simulate_alone_imports_nothing_of_it", "test_natural_coordinates_show_the_same",
    ),
    "tests/view/test_visuals.py": ("test_sides_look_along_an_axis", "test_the_table_is_saved_with_its_units"),
}  # fmt: skip

KEPT: Mapping[str, Mapping[str, tuple[str, ...]]] = {
    "tests/compile_run/test_generated.py": {
        "test_long_functions_are_compiled_in_parts": ("g++",),
        "test_every_joint_kind_compiles_and_equals_the_interpreter": ("*universal",),
    },
    "tests/compile_run/test_loops.py": {
        "test_loops_compile": ("numbers, batch",),
    },
    "tests/coupling/test_misbehaving.py": {
        "test_what_changes_no_value_leaves_the_table_whole": ("DoStep-flood",),
    },
    "tests/coupling/test_with.py": {
        "test_two_models_step_side_by_side_as_by_hand": ("3",),
        "test_a_controller_steers_a_guide_as_a_law_does": ("0.002",),
    },
    "tests/edges/test_commands.py": {
        "test_bad_values": ("simulate-*",),
    },
    "tests/fmu/test_archive.py": {
        "test_fmpy_has_the_table_of_the_command_line_bit_by_bit": ("press-None-3",),
        "test_the_layer_compiles_without_warnings_and_takes_a_prefix": ("cs-g++-2", "me-g++-3", "both-clang++-3"),
        "test_a_binary_shows_the_standards_functions_alone_and_needs_the_c_library_alone": ("3",),
        "test_fmpy_finds_nothing_wrong": ("3-*", "2-driven*"),
    },
    "tests/fmu/test_events.py": {
        "test_inputs_jump_in_event_mode": ("rk4",),
        "test_wrong_calls": ("cs",),
    },
    "tests/fmu/test_exchange.py": {
        "test_cvode_has_the_motion_of_the_command_line": ("press-2",),
        "test_what_changes_depends_on_what_was_changed": ("spinning",),
        "test_states_are_chosen_anew_as_a_ball_turns_and_the_motion_stays": ("3",),
        "test_directional_derivatives_are_those_of_a_closed_form": ("2",),
        "test_co_simulation_beside_model_exchange_is_that_alone": ("2",),
        "test_states_that_loops_cannot_reach_are_discarded_and_leave_the_instance": ("3",),
        "test_saved_states_go_on_bit_by_bit": ("3",),
        "test_a_force_that_was_left_out_and_would_act_ends_the_simulation_as_it_ends_a_step": ("3",),
        "test_fmpy_finds_nothing_wrong": ("3-*", "2-driven*"),
    },
    "tests/fmu/test_steps.py": {
        "test_outputs_that_change_at_the_start_depend_on_what_was_set": ("driven-2", "press-3"),
        "test_states_go_on_bit_by_bit_in_any_instance": ("3",),
        "test_states_before_the_start_return_there": ("3",),
        "test_instances_are_independent_and_reset": ("3",),
        "test_steps_of_any_length_are_those_of_the_interface": ("3",),
    },
    "tests/fuzz/test_kinds.py": {
        "test_some_seeds": ("calls",),
    },
    "tests/fuzz/test_models.py": {
        "test_nasty_names_and_units_are_refused_or_harmless": ("name", "unit", "parameter"),
    },
    "tests/packaging/test_bare.py": {
        "test_runs_are_those_of_generated_code": ("with_this_machines-recursive-trapezoidal",),
        "test_what_takes_generated_code_says_so": ("*simulate",),
    },
    "tests/run/test_binary_tables.py": {
        "test_another_run_may_be_compared": (".parquet",),
    },
    "tests/run/test_failing_starts.py": {
        "test_a_loop_that_cannot_close_is_reported_in_the_same_words_everywhere": ("guide",),
    },
    "tests/run/test_files.py": {
        "test_a_signal_says_when_it_came_and_where_the_rows_are": ("15-*",),
    },
    "tests/run/test_roads.py": {
        "test_disc_envelope_is_the_largest_height_under_the_disc": ("0", "3"),
    },
    "tests/runtime/test_bordered.py": {
        "test_solutions_of_bordered_systems": ("native",),
    },
    "tests/runtime/test_fixed_point.py": {
        "test_two_masses": ("k1-c1", "k3-c3"),
    },
    "tests/runtime/test_no_allocation.py": {
        "test_steps_of_the_vehicle_do_not_allocate": ("recursive-proximal-*",),
    },
    "tests/runtime/test_realtime.py": {
        "test_what_has_no_fixed_cost": ("how1",),
    },
    "tests/runtime/test_shortest_text.py": {
        "test_texts_are_those_of_the_library": ("plain",),
    },
    "tests/sweeps/test_as_simulated.py": {
        "*": ("stopped",),
        "test_an_fmu_has_them_too": ("3-stopped",),
        "test_what_decides": ("*",),
    },
    "tests/sweeps/test_lanes.py": {
        "test_runs_of_a_press": ("proximal",),
        "test_other_ways_to_run_have_no_lanes": ("*rk4*",),
    },
    "tests/sweeps/test_parts.py": {
        "test_damage_before_a_call": (
            "flip", "cut", "rename", "swap", "another seed", "lose", "folder", "unfinished", "lose manifest", "another manifest",
        ),
        "test_damage_while_rows_come": ("lose", "flip", "another seed"),
    },
    "tests/sweeps/test_sweep.py": {
        "test_a_call_that_was_stopped_goes_on": ("9",),
        "test_chunks_have_work_enough": ("2-1000-100",),
    },
    "tests/toolchain/test_compiler.py": {
        "test_a_program_that_does_not_compile": ("/bin/true*",),
        "test_a_compiler_in_any_folder": ("a;b*",),
    },
    "tests/toolchain/test_damage.py": {
        "test_a_damaged_part_of_the_driver_is_built_again": ("a bit flipped",),
    },
    "tests/toolchain/test_flags.py": {
        "test_what_makes_no_program_is_named": ("no option", "syntax"),
    },
    "tests/toolchain/test_hostile_folders.py": {
        "test_builds_take_nothing_from_the_present_folder": ("./:*",),
    },
    "tests/toolchain/test_objects.py": {
        "test_what_is_not_of_the_dynamics_does_not_compile_them_again": ("an output",),
    },
    "tests/toolchain/test_paths.py": {
        "test_any_name_of_the_cache_and_of_folders": ("no *",),
        "test_any_name_of_the_installation": ("two*",),
    },
    "tests/view/test_drive_options.py": {
        "test_a_replay_refuses_what_no_page_has_saved": ("change0-*", "change7-*"),
    },
    "tests/view/test_every_view.py": {
        "test_models": ("*-four_bar",),
        "test_forces": ("simulate", "check"),
    },
    "tests/view/test_graph.py": {
        "test_every_element_is_there_once": ("excavator", "four_bar", "iltis", "press"),
        "test_bodies_do_not_cover_each_other": ("excavator", "four_bar", "iltis", "press"),
    },
}  # fmt: skip
