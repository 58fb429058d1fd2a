// Watches that forces which were left out of a model do not act.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "cutjoint/mechanism.hpp"
#include "cutjoint/state.hpp"

namespace cutjoint {

/// The guards of a mechanism or system; nothing allocates while they hold, and without guards nothing is called.
template <class Subject>
class Guards {
 public:
  using Real = typename Subject::real_type;

  explicit Guards(Subject& subject) : subject_(subject), guards_(subject.description().guards), margin_(guards_.size()) {}

  bool empty() const { return guards_.empty(); }

  /// Throws Failure that names the forces which would act in the state at the end of a step; `begin_step` has been called for its time.
  void check(const State<Real>& state, long number) {
    if (empty()) return;
    subject_.guard(state.q.data(), state.v.data(), margin_.data());
    for (const Real margin : margin_)
      if (!(margin >= Real(0))) stop(static_cast<double>(state.t), number);
  }

 private:
  [[noreturn]] void stop(double t, long number) const {
    std::vector<std::string> violated;
    std::size_t worst = 0;
    for (std::size_t i = 0; i < margin_.size(); ++i) {
      if (!(margin_[i] >= margin_[worst])) worst = i;
      if (!(margin_[i] >= Real(0))) violated.emplace_back(guards_[i].force);
    }
    const std::string name(guards_[worst].force), place(guards_[worst].place);
    Failure failure("the guard of '" + name + "' (" + place + ") is violated: the force would act", t, number, name,
                    static_cast<double>(-margin_[worst]), "run the full model, or with on_violation: restart");
    failure.guards = violated;
    throw failure;
  }

  Subject& subject_;
  std::vector<Guard> guards_;
  std::vector<Real> margin_;
};

}  // namespace cutjoint
