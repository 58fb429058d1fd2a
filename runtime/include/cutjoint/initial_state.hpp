// The start of a run in relative coordinates, as requested by its run file.
#pragma once

#include <numeric>

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
                         .fixed_point_step = fixed_point_step(settings)},
                        data_.parameters().data(), data_.roads().data()),
        depends_on_{{"fixed_point_step", fixed_point_step(settings)}, {"stabilisation", file.at("stabilisation")}} {}

  InitialState(const InitialState&) = delete;
  InitialState& operator=(const InitialState&) = delete;

  /// A mechanism at rest, with guides at rest.  Throws Failure.
  const State<Real>& at_rest() {
    require_none(initialisation_.rest(state_, read_positions()), d_);
    read_reactions();
    return state_;
  }

  /// A mechanism in motion, with velocities that satisfy its loops: at the start, or continued from "initial_state" of the run file.  Throws Failure.
  /// A "start" that another run of the file has found is taken as it is, if it does not depend on steps or has the same.
  const State<Real>& in_motion();

  /// The start in motion that further runs of the file may take; null if JSON cannot hold it.
  Json found() const {
    const auto sum = [](const std::vector<Real>& numbers) { return std::accumulate(numbers.begin(), numbers.end(), Real(0)); };
    if (!std::isfinite(sum(state_.q) + sum(state_.v) + sum(state_.vdot) + sum(state_.lambda) + sum(penalties()))) return {};
    return {{"q", state_.q}, {"v", state_.v}, {"vdot", state_.vdot}, {"lambda", state_.lambda}, {"penalties", penalties()},
            {"undetermined", undetermined_}, {"locking_forces", reactions_}, {"depends_on", depends_on_}};
  }

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
  /// The length of the steps on which penalties depend, 0 if they do not.
  static double fixed_point_step(const RunSettings& settings) { return settings.integrator == Integrator::trapezoidal ? settings.dt : 0.0; }

  /// The start that `found` has returned.
  const State<Real>& taken(const Json& start) {
    state_.q = read_numbers<Real>(start, "q"), state_.v = read_numbers<Real>(start, "v");
    state_.vdot = read_numbers<Real>(start, "vdot"), state_.lambda = read_numbers<Real>(start, "lambda");
    initialisation_.load(read_numbers<Real>(start, "penalties"));
    undetermined_ = start.at("undetermined").get<std::vector<std::string>>(), reactions_ = start.at("locking_forces");
    return state_;
  }

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
  const Json depends_on_;  ///< the settings that a start follows from and that runs of one file may change
};

template <Mechanism M>
const State<typename M::real_type>& InitialState<M>::in_motion() {
  if (file_.contains("initial_state")) return continued(file_.at("initial_state"));
  if (file_.contains("start") && file_.at("start").at("depends_on") == depends_on_) return taken(file_.at("start"));
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
