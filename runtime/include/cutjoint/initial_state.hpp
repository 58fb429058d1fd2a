// The start of a run in relative coordinates, as requested by its run file.
#pragma once

#include "cutjoint/core/start/initialisation.hpp"
#include "cutjoint/domains.hpp"
#include "cutjoint/run_file.hpp"
#include "cutjoint/settings.hpp"

namespace cutjoint {

/// Loads a mechanism with the settings of a run and finds the state from which the run starts.
template <Mechanism M>
class InitialState {
 public:
  using Real = typename M::real_type;

  InitialState(M& mechanism, const RunSettings& settings, const Json& file)
      : mechanism_(mechanism), d_(mechanism.description()), file_(file), state_(d_), data_(d_, file),
        initialisation_(driven(mechanism),
                        {.stabilisation = settings.stabilisation,
                         .equilibrium = settings.pose == Pose::equilibrium,
                         .fixed_point_step = settings.integrator == Integrator::trapezoidal ? Real(settings.dt) : Real(0)},
                        data_.parameters().data(), data_.roads().data()) {}

  InitialState(const InitialState&) = delete;
  InitialState& operator=(const InitialState&) = delete;

  /// A mechanism at rest, with guides at rest.  Throws Failure.
  const State<Real>& at_rest() {
    require_none(initialisation_.rest(state_, read_positions()), d_);
    read_reactions();
    return state_;
  }

  /// A mechanism in motion, with velocities that satisfy its loops: at the start, or continued from "initial_state" of the run file.  Throws Failure.
  const State<Real>& in_motion();

  /// Adds the known cause to a failure to start.
  Failure explain(const Failure& failure) { return explain_by_domains(mechanism_, state_, Real(0), failure); }

  M& mechanism() { return mechanism_; }

  /// Parameters, roads and inputs of the mechanism.
  ModelData<Real>& data() { return data_; }

  /// Penalties of the cut joints, known when a start has been found; the closure `penalty` has one for all.
  const std::vector<Real>& penalties() const { return initialisation_.penalties(); }

  /// Reaction forces of the coordinates that the run file prescribes in the pose at rest, by names of velocities; only nonzero ones.
  const Json& reactions() const { return reactions_; }

  /// Independent velocities that neither run file nor loops determine.
  const std::vector<std::string>& undetermined() const { return undetermined_; }

 private:
  /// The state reached by other code, projected onto the loops.
  const State<Real>& continued(const Json& begin);

  void read_reactions() {
    const auto& forces = initialisation_.reactions();
    for (std::size_t i = 0; i < d_.speeds.size(); ++i)
      if (forces[i] != Real(0)) reactions_[std::string(d_.speeds[i])] = static_cast<double>(forces[i]);
  }

  /// The mechanism with the inputs of the run.
  M& driven(M& mechanism) {
    data_.drive(mechanism);
    return mechanism;
  }

  /// Read values of the run file, and mark those that are given.
  std::vector<unsigned char> read(const char* key, const List<const char*>& names, std::vector<Real>& values) const {
    const std::vector<bool> given = read_given(file_.at(key), names, values);
    return {given.begin(), given.end()};
  }

  /// Read coordinates of the run file, and mark how they are given.
  std::vector<unsigned char> read_positions() {
    std::vector<unsigned char> given = read("positions", d_.coordinates, state_.q);
    if (!file_.contains("near")) return given;
    for (const Json& name : file_.at("near")) {
      const auto place = std::find(d_.coordinates.begin(), d_.coordinates.end(), name.get<std::string_view>()) - d_.coordinates.begin();
      if (unsigned char& how = given.at(static_cast<std::size_t>(place)); how != not_given) how = given_as_guess;
    }
    return given;
  }

  M& mechanism_;
  const Description& d_;
  const Json& file_;
  State<Real> state_;
  ModelData<Real> data_;
  Initialisation<M> initialisation_;
  std::vector<std::string> undetermined_;
  Json reactions_ = Json::object();
};

template <Mechanism M>
const State<typename M::real_type>& InitialState<M>::in_motion() {
  if (file_.contains("initial_state")) return continued(file_.at("initial_state"));
  require_none(initialisation_.place(state_, read_positions()), d_);
  initialisation_.find_reactions(state_);
  read_reactions();
  const std::vector<unsigned char> moving = read("rates", d_.speeds, state_.v);
  std::vector<unsigned char> free(moving.size());
  initialisation_.find_undetermined(state_, moving, free);
  for (std::size_t i = 0; i < free.size(); ++i)
    if (free[i]) undetermined_.push_back(std::string(d_.speeds[i]));
  require_none(initialisation_.move(state_, moving), d_);
  return state_;
}

template <Mechanism M>
const State<typename M::real_type>& InitialState<M>::continued(const Json& begin) {
  state_.t = read_number<Real>(begin, "t");
  read_given(begin.at("q"), d_.coordinates, state_.q), read_given(begin.at("v"), d_.speeds, state_.v);
  require_none(initialisation_.place(state_, std::vector<unsigned char>(state_.q.size())), d_);
  require_none(initialisation_.move(state_, std::vector<unsigned char>(state_.v.size())), d_);
  return state_;
}

extern template class InitialState<AnyMechanism<double>>;  // initial_state.cpp of the driver, since it takes long to compile

}  // namespace cutjoint
