// Checks that forces omitted from a model would not act, and that omitted equations hold.
#pragma once

#include "cutjoint/core/mechanism/loop_fits.hpp"
#include "cutjoint/state.hpp"

namespace cutjoint {

/// The failure of a state with violated `margins` of guards: it names the forces that would act.
template <class Real>
Failure failure_of_guards(const List<Guard>& guards, const std::vector<Real>& margins, double t, long number) {
  std::vector<std::string> violated;
  std::size_t worst = 0;
  for (std::size_t i = 0; i < margins.size(); ++i) {
    if (!(margins[i] >= margins[worst])) worst = i;
    if (!(margins[i] >= Real(0))) violated.emplace_back(guards[i].force);
  }
  const std::string name(guards[worst].force), place(guards[worst].place);
  const bool ends = guards[worst].ends;
  if (guards[worst].left_out)
    return Failure("equation '" + name + "' (" + place + ") stands open: it was left out, since others implied it in the only pose that was known", t,
                   number, name, static_cast<double>(-margins[worst]),
                   "the joint is not held there, as of loops that close in one pose only: look at its axes and points, or take method augmented or recursive");
  const bool opens = ends && static_cast<double>(margins[worst]) <= margin_of_open_loops;
  const std::string what = opens  ? "its loops do not close over the range of their functions with these parameters"
                           : ends ? "the functions of its loops end there"
                                  : "the force would act";
  Failure failure("the guard of '" + name + "' (" + place + ") is violated: " + what, t, number, name, opens ? 1 : static_cast<double>(-margins[worst]),
                  ends ? "run with loops: exact, with on_violation: restart, or with more loop_terms" : "run the full model, or with on_violation: restart");
  failure.guards = violated;
  return failure;
}

/// The guards of a mechanism or system; nothing allocates while they hold, and without guards nothing is called.
template <class Subject>
class Guards {
 public:
  using Real = typename Subject::real_type;

  explicit Guards(Subject& subject) : subject_(subject), guards_(subject.description().guards), margin_(guards_.size()) {}

  bool empty() const { return guards_.empty(); }

  /// Throws Failure that names the omitted forces that would act at the end of a step; `begin_step` has been called for its time.
  void check(const State<Real>& state, long number) {
    if (empty()) return;
    subject_.guard(state.q.data(), state.v.data(), margin_.data());
    for (const Real margin : margin_)
      if (!(margin >= Real(0))) throw failure_of_guards(guards_, margin_, static_cast<double>(state.t), number);
  }

 private:
  Subject& subject_;
  const List<Guard>& guards_;
  std::vector<Real> margin_;
};

}  // namespace cutjoint
