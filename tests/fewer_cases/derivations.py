"""Tests of models, equations, analyses, programs and their code: those for `make full` alone, and the cases that stay in `make test`."""

from __future__ import annotations

from collections.abc import Mapping

FULL: Mapping[str, tuple[str, ...]] = {
    "tests/analysis/test_aims.py": (
        "test_a_slider_is_where_it_is_wanted_by_all_methods[augmented]", "test_a_slider_is_where_it_is_wanted_by_all_methods[classical]",
        "test_a_study_varies_what_the_start_does_not_follow_from[heavy*]",
        "test_a_simulation_that_python_holds_is_assembled_with_its_parameters", "test_each_run_of_a_batch_has_its_own_start",
    ),
    "tests/analysis/test_assembled.py": (
        "test_a_guided_coordinate_moves_an_assembly", "test_a_guide_that_stands_still_is_watched",
        "test_coarse_functions_keep_the_energy", "test_a_run_that_leaves_the_range_stops_or_starts_again",
        "test_newtons_method_has_functions",
    ),
    "tests/analysis/test_check.py": ("test_iltis",),
    "tests/analysis/test_compliance.py": (
        "test_the_chassis_is_held_where_it_is_no_ground", "test_an_axle_on_joints_alone_does_not_give_way",
    ),
    "tests/analysis/test_conditioning.py": (
        "test_no_other_cut_of_a_loop_is_as_cheap_and_better_conditioned[<lambda>[257]]",
        "test_another_cut_changes_the_redundant_equations_as_its_kind_says[<lambda>1]",
    ),
    "tests/analysis/test_fitted.py": (
        "test_full_turns_by_generated_code", "test_a_host_changes_a_point_between_steps", "test_a_step_is_differentiated_by_a_point",
        "test_loops_that_do_not_close_are_reported_and_left_to_their_equations",
    ),
    "tests/analysis/test_going_on.py": ("test_a_guide_that_moves_carries_over", "test_equal_steps_go_on"),
    "tests/analysis/test_guides.py": ("test_commands_end_with_the_reason[arguments[24]*]", "test_the_slalom_is_not_refused"),
    "tests/analysis/test_inertia.py": ("test_a_massless_link_between_two_balls_is_named", "test_no_code_is_generated"),
    "tests/analysis/test_kinematics.py": ("test_the_command_draws_a_picture_of_each_sweep", "test_wheels_that_turn_are_those_of_an_axle"),
    "tests/analysis/test_linearisation.py": ("test_trees_in_motion", "test_cut_joints_in_motion"),
    "tests/analysis/test_modes.py": ("test_shimmy_of_a_caster", "test_a_caster_shimmies_below_the_relaxation_length", "test_vehicle"),
    "tests/analysis/test_rigid.py": (
        "test_a_misfit_that_leaves_no_motion_is_reported_by_check_and_runs", "test_the_command_line_warns_each_time",
        "test_a_turned_bennett_linkage_with_rounded_corners_moves",
    ),
    "tests/analysis/test_shaky.py": (
        "test_equations_that_classical_leaves_out_in_one_pose_are_watched[compile_scene1]", "test_folders_watch_them_too",
        "test_classical_drops_nothing_on_the_one_pose",
    ),
    "tests/analysis/test_skew.py": (
        "test_models_with_axes_in_space_have_none[delta]", "test_models_with_axes_in_space_have_none[stewart]",
    ),
    "tests/emit/test_source.py": ("test_a_check_of_the_run_leaves_the_other_functions_as_they_are",),
    "tests/formulate/test_against_dense.py": ("test_iltis",),
    "tests/formulate/test_cut_coordinates.py": ("test_each_joint_of_a_sprung_loop_can_be_cut",),
    "tests/formulate/test_energy.py": ("test_trees", "test_loops"),
    "tests/formulate/test_implicit.py": (
        "test_tangent_with_gears[0-True]", "test_tangent_of_models[iltis*]", "test_stretch_and_pull_are_one_matrix[iltis]",
        "test_tangent_with_ball_springs", "test_tangent_with_contacts",
    ),
    "tests/formulate/test_invariants.py": ("test_distance_driven_costs_no_digit",),
    "tests/formulate/test_law_derivatives.py": ("test_derivatives_of_laws_are_finite_far_beyond_usual_arguments",),
    "tests/formulate/test_natural.py": (
        "test_geared_tree", "test_coupled_loops", "test_equations_that_depend_on_others_are_found",
        "test_an_open_parameter_moves_the_points", "test_model[flyball*]", "test_contacts", "test_ball_springs",
    ),
    "tests/formulate/test_proximal.py": (
        "test_accelerations_are_those_without_a_penalty[iltis-*]", "test_multipliers_balance_the_forces[iltis]",
        "test_one_evaluation_solves_for_the_multipliers[iltis]", "test_a_heavy_penalty_loses_digits[iltis]",
    ),
    "tests/formulate/test_reactions.py": ("test_tree_joints_in_natural_coordinates",),
    "tests/formulate/test_reports.py": ("test_reactions_of_guided_and_geared_joints",),
    "tests/formulate/test_signals.py": (
        "test_natural_coordinates_have_the_tangent_of_all_that_laws_read", "test_the_classical_tangent_has_states",
        "test_recursive_newton_has_the_exact_tangent",
    ),
    "tests/images/test_images.py": (
        "test_an_image_moves_as_its_original[axle-*]", "test_an_image_moves_as_its_original[rods-recut]",
        "test_an_image_moves_as_its_original[rods-scaled by 1000]", "test_an_image_moves_as_its_original[spatial 2-*]",
        "test_an_image_moves_as_its_original[andrews*]", "test_an_image_moves_as_its_original[spatial 1*]",
    ),
    "tests/model/test_controllers.py": ("test_signals_that_read_each_other_in_a_long_row",),
    "tests/model/test_instances.py": ("test_the_number_of_elements_is_bounded",),
    "tests/model/test_new_kind.py": ("test_units_follow_from_the_chain_and_not_from_names",),
    "tests/model/test_problems.py": ("test_problems_without_end_are_cut_short",),
    "tests/model/test_shapes.py": ("test_a_value_of_the_wrong_form_hides_no_other_problem_and_makes_none",),
    "tests/model/test_source.py": (
        "test_size_attacks_end_quickly[text2*]", "test_size_attacks_end_quickly[text3*]", "test_merge_keys_are_counted",
    ),
    "tests/model/test_tunable.py": (
        "test_a_tunable_model_with_the_numbers_of_the_file_is_the_model[iltis_driven]",
        "test_a_tunable_model_with_the_numbers_of_the_file_is_the_model[axle]",
        "test_a_tunable_model_with_the_numbers_of_the_file_is_the_model[car]",
        "test_a_tunable_model_with_the_numbers_of_the_file_is_the_model[stewart]",
        "test_a_tunable_model_with_the_numbers_of_the_file_is_the_model[iltis]",
        "test_runs_with_other_numbers_are_those_of_another_file[augmented]", "test_the_command_opens_and_says_the_price",
    ),
    "tests/program/test_fold.py": (
        "test_lanes_do_not_depend_on_labels[augmented]", "test_the_augmented_tangent_of_an_axle_folds",
        "test_an_axle_folds_with_its_tangent",
    ),
    "tests/program/test_transposed.py": ("test_models[iltis*]", "test_the_balance_of_forces[iltis*]", "test_models[axle*]"),
    "tests/reduce/test_choose.py": (
        "test_an_impossible_accuracy_says_what_came_nearest", "test_the_chain_keeps_its_tolerance_across_its_singular_pose",
        "test_reduce_prints_the_sequence", "test_the_pendulum_keeps_its_tolerance",
    ),
    "tests/reduce/test_guards.py": (
        "test_the_car_s_bumpers_stay_out_of_reach_on_a_smooth_bump", "test_the_car_s_bumpers_act_where_steps_lead_down",
    ),
    "tests/reduce/test_passes.py": (
        "test_sequence_of_the_iltis_with_its_rack_at_rest", "test_outputs_keep_their_columns", "test_sequence_of_the_iltis",
    ),
    "tests/reduce/test_rolling.py": ("test_its_guard_trips_where_the_force_would_get_large[recursive-newton]",),
    "tests/reduce/test_trials.py": (
        "test_a_run_is_the_same_when_its_code_is_compiled[augmented]", "test_a_run_is_the_same_when_its_code_is_compiled[classical]",
    ),
    "tests/report/test_explain.py": ("test_the_same_bytes_under_any_hash_seed", "test_every_element_is_explained_with_its_line[iltis]"),
    "tests/report/test_explain_formulas.py": (
        "test_printed_formulas[flyball-augmented]", "test_printed_formulas[flyball-classical]",
        "test_printed_formulas_of_every_force[augmented]", "test_printed_formulas_of_every_force[classical]",
    ),
    "tests/sparse/test_factorisation.py": (
        "test_a_pivot_that_is_not_finite_is_reported", "test_clang_takes_it_too", "test_same_bytes_under_any_hash_seed",
    ),
    "tests/topology/test_operations.py": (
        "test_random_models", "test_iltis_cut_elsewhere", "test_placing_of_the_costliest_kinds",
        "test_a_vehicle_takes_what_is_predicted",
    ),
}  # fmt: skip

KEPT: Mapping[str, Mapping[str, tuple[str, ...]]] = {
    "tests/analysis/test_aims.py": {
        "test_random_mechanisms_find_a_pose_with_the_places_of_another": ("3",),
    },
    "tests/analysis/test_assembled.py": {
        "test_random_mechanisms_move_as_by_their_loops_equations": ("0-spatial",),
        "test_the_tangent_is_that_of_the_residual": ("spatial",),
    },
    "tests/analysis/test_closing.py": {
        "test_residual_and_jacobian": ("0", "2"),
        "test_poses_close_the_loops_and_differ": ("3", "7"),
    },
    "tests/analysis/test_compliance.py": {
        "test_small_loads_move_wheels_as_finite_ones_do": ("braking", "driving"),
    },
    "tests/analysis/test_fitted.py": {
        "test_random_mechanisms_with_other_points_move_as_by_their_loops_equations": ("0-four_bar",),
    },
    "tests/analysis/test_going_on.py": {
        "test_a_run_that_leaves_the_range_is_that_of_the_loops_equations": ("plane",),
    },
    "tests/analysis/test_guides.py": {
        "test_contradictory_locks_are_refused": ("*-recursive", "late-*"),
    },
    "tests/analysis/test_inertia.py": {
        "test_random_models_with_massless_links_are_what_the_oracle_says": ("random_loops-1", "random_tree-7"),
    },
    "tests/analysis/test_mobility.py": {
        "test_ranks_are_the_oracles": ("1", "7"),
    },
    "tests/analysis/test_neutral.py": {
        "test_a_line_names_the_largest_side_force_of_standing_tyres": ("*kind: revolute*",),
    },
    "tests/analysis/test_redundancy.py": {
        "test_what_is_kept_is_independent_and_any_named_equation_may_go_instead": ("7", "9"),
    },
    "tests/analysis/test_rigid.py": {
        "test_a_misfit_within_the_accuracy_is_taken_out": ("1e-06-1.0",),
        "test_a_larger_misfit_is_refused_by_all_methods": ("recursive",),
        "test_exact_cranks_have_the_change_point": ("1e-06",),
        "test_cranks_with_a_misfit_move_as_exact_ones": ("1e-05-1.0-augmented", "1e-06-0.001-recursive", "1e-10-1.0-recursive*"),
        "test_cranks_with_a_misfit_pass_their_change_point_as_exact_ones": ("recursive",),
    },
    "tests/analysis/test_skew.py": {
        "test_random_loops_have_none": ("1", "3", "9"),
    },
    "tests/emit/test_names.py": {
        "test_a_model_may_be_called_as_what_the_runtime_has": ("weights-augmented",),
        "test_words_of_cpp_are_names": ("recursive",),
        "test_a_model_may_be_called_by_a_word_of_cpp": ("main", "std", "errno"),
    },
    "tests/emit/test_source.py": {
        "test_same_bytes_under_any_hash_seed": ("four_bar-*",),
    },
    "tests/formulate/test_against_dense.py": {
        "test_cut_joint": (
            "fixed-roots", "revolute-roots", "prismatic-roots", "cylindrical-roots", "screw-roots",
            "universal-roots", "planar-roots", "spherical-roots", "point_on_line-roots", "distance-roots", "constant_velocity-roots",
            "point_on_plane-roots", "parallel_axes-roots",
        ),
        "test_tree_joint": (
            "screw-normal-0", "universal-reversed-0", "planar-normal-0", "point_on_line-normal-0", "distance-normal-0",
            "constant_velocity-normal-0", "point_on_plane-normal-0", "parallel_axes-normal-0",
        ),
        "test_cut_joint_to_ground": ("universal-*", "distance-*", "planar-base_inside"),
        "test_random_tree": ("[12]",),
        "test_coupled_loops": ("[12]",),
        "test_parts_around_a_hub": ("[02]",),
        "test_geared_tree": ("0-*", "3-True"),
        "test_geared_loops": ("1-*",),
        "test_contacts": ("[02]",),
        "test_ball_springs": ("[12]",),
        "test_cuts_chosen_by_the_compiler": ("[12]",),
        "test_guided_joint": ("screw", "universal", "planar"),
    },
    "tests/formulate/test_against_pinocchio.py": {
        "test_tree_joint": ("*-normal",),
        "test_random_tree": ("2[0-2]",),
    },
    "tests/formulate/test_cut_coordinates.py": {
        "test_tangents_have_them": ("planar-branch",),
        "test_rates_are_those_of_the_positions": ("screw-roots",),
        "test_forces_have_the_power_of_their_coordinates": ("screw-branch", "planar-roots", "revolute-branch", "point_on_line-roots"),
    },
    "tests/formulate/test_energy.py": {
        "test_guided_joints": ("screw",),
        "test_gears": ("3-True",),
    },
    "tests/formulate/test_implicit.py": {
        "test_tangent_of_loops": ("screw-roots", "universal-roots", "planar-roots", "point_on_line-guided"),
        "test_tangent_of_random_loops": ("2",),
        "test_tangent_of_random_trees": ("2",),
        "test_tangent_with_gears": ("0-*",),
        "test_tangent_of_trees": ("screw-False", "universal-True"),
        "test_penalty_of_loops": ("parent", "guided"),
        "test_balance_vanishes_where_the_recursion_says": ("2",),
    },
    "tests/formulate/test_invariants.py": {
        "test_energy_changes_by_the_power_of_the_forces": ("3", "7"),
        "test_augmented_update_ends_at_the_constrained_motion": ("7", "11"),
        "test_momentum_of_free_bodies_stays": ("0", "2", "5"),
        "test_motion_does_not_depend_on_the_root": ("universal", "screw", "planar", "point_on_line"),
    },
    "tests/formulate/test_mirror.py": {
        "test_the_image_moves_as_the_mirror_shows": ("*-True-y",),
    },
    "tests/formulate/test_natural.py": {
        "test_cut_joint": ("point_on_line-parent",),
        "test_tree_joint": ("screw-reversed",),
        "test_reaction_of_a_cut_joint": ("screw",),
        "test_tangents": ("slider_crank-None",),
        "test_model": ("*slider_crank*", "*flyball*"),
        "test_tangents_of_random_models": ("1-True",),
        "test_random_tree": ("2",),
        "test_guided_joint": ("screw", "universal"),
        "test_coordinates_and_equations": ("four_bar*", "andrews*"),
    },
    "tests/formulate/test_proximal.py": {
        "test_a_correction_inside_is_a_correction_outside": ("2-*",),
        "test_loops_across_branches": ("universal", "point_on_line"),
    },
    "tests/formulate/test_reports.py": {
        "test_reaction_of_a_tree_joint": ("universal",),
        "test_reaction_of_a_cut_joint": ("universal", "distance"),
        "test_loops": ("1",),
    },
    "tests/formulate/test_rotors.py": {
        "test_rotors_move_as_other_bodies_do": ("tree", "free"),
    },
    "tests/formulate/test_samples.py": {
        "test_samples_are_what_outputs_report": ("recursive-newton-0",),
    },
    "tests/images/test_images.py": {
        "test_equal_steps_are_the_same_in_all_units_of_length": (
            "recursive-*", "recursive-newton-0.01", "augmented-1e-05", "classical-10000.0",
        ),
        "test_adaptive_steps_are_the_same_in_all_units_of_length": ("gantry-*", "light rods-10000.0"),
    },
    "tests/model/test_laws.py": {
        "test_cubics_follow_values_that_are_symbols": ("?", "1?"),
    },
    "tests/model/test_property_files.py": {
        "test_each_kind_of_file_has_its_submodel": ("*FITTYP = 52", "*FITTYP = 61"),
        "test_coefficients_that_a_file_lacks_or_leaves_blank_are_those_of_the_format": ("*nothing",),
    },
    "tests/model/test_source.py": {
        "test_long_chains_of_merge_keys_are_refused": ("[*]a4999",),
    },
    "tests/program/test_fold.py": {
        "test_folded_program_computes_the_same": ("arms with controllers", "*pendulums*", "axle*"),
    },
    "tests/program/test_loops.py": {
        "test_loops_compute_the_same": ("*-True",),
        "test_the_code_of_a_chain_does_not_grow": ("project",),
    },
    "tests/program/test_lowering.py": {
        "test_scalars_give_what_blocks_give": ("tree-1-*", "loops-1-*", "loops-5-*", "chosen-0-*", "four_bar-*"),
        "test_a_node_is_known_no_earlier_than_its_arguments": ("tree-1", "loops-1", "loops-5", "chosen-*", "four_bar"),
        "test_equal_nodes_are_one": ("tree-1", "loops-1", "loops-5", "chosen-*", "four_bar"),
        "test_stages_run_in_turn": ("tree-1", "loops-1", "loops-5", "chosen-1"),
    },
    "tests/reduce/test_passes.py": {
        "test_what_is_cheapest_of_a_sequence_is_the_end_of_a_method_s_own": ("recursive",),
    },
    "tests/reduce/test_planar.py": {
        "test_a_mechanism_in_its_plane_moves_as_before": ("augmented*",),
        "test_any_tree_in_a_plane": ("[0-4]",),
    },
    "tests/report/test_explain.py": {
        "test_the_tree_is_a_list_indented_by_depth": ("four_bar",),
    },
    "tests/sparse/test_factorisation.py": {
        "test_indefinite_systems": ("1-straight",),
        "test_positive_definite_systems": ("2-tables",),
        "test_small_systems": ("3-straight",),
        "test_a_pivot_that_is_not_positive_is_reported": ("tables",),
        "test_a_pivot_of_zero_is_reported": ("tables",),
    },
    "tests/topology/test_search.py": {
        "test_no_cuts_by_hand_take_fewer_operations": ("slider_crank*",),
    },
}  # fmt: skip
