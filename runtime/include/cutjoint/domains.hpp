// Finds the law without a value that made a step fail.
#pragma once

#include <cstdio>

#include "cutjoint/core/mechanism/retraction.hpp"
#include "cutjoint/state.hpp"

namespace cutjoint {

/// The failure of a step by a law outside its domain.
inline Failure left_domain(const Domain& domain, double margin, const Failure& failure) {
  const std::string what = "the law of '" + std::string(domain.element) + "' (" + std::string(domain.place) + ") has no finite value: " +
                           std::string(domain.what) + " leaves its domain";
  return Failure(what, failure.time, failure.step, std::string(domain.element), margin,
                 "give the law a value wherever the motion may lead, with where(condition, value, other), or keep the motion out");
}

/// The failure of a step by a joint load without a value; coefficients of friction below `most` times the present ones would give it one.
inline Failure left_load(const Domain& domain, double margin, double most, const Failure& failure) {
  const double unit = std::pow(10.0, std::floor(std::log10(most)) - 2.0);
  char factor[32];
  std::snprintf(factor, sizeof factor, "%.3g", std::floor(most / unit) * unit);
  const std::string what = "the friction of '" + std::string(domain.element) + "' (" + std::string(domain.place) +
                           ") leaves the load of the joint without a value, or with several (Painleve)";
  return Failure(what, failure.time, failure.step, std::string(domain.element), margin,
                 "take coefficients of friction " + std::string(factor) + " times as large, or smaller: with these there is one value here");
}

/// Finds the first law of a mechanism or system that leaves its domain after a state.
template <class Subject>
class Domains {
 public:
  using Real = typename Subject::real_type;

  Domains(Subject& subject, const State<Real>& from)
      : subject_(subject), domains_(subject.description().domains), from_(from), at_(from), delta_(from.v.size()), inside_(domains_.size()), outside_(domains_.size(), 1),
        forces_(std::max(from.v.size(), from.q.size())), residual_(std::max(from.lambda.size(), forces_.size())) {}

  /// The failure that names the law; the given one if all laws have values over a time h with constant accelerations.
  Failure explain(const Failure& failure, Real h) {
    constexpr int parts = 64;
    const Domain* left = nullptr;
    for (int part = 0; part <= parts && !left; ++part) {
      go(h * Real(part) / Real(parts));
      left = find();
    }
    subject_.begin_step(from_.t, Real(1));
    if (!left) return failure;
    const double margin = static_cast<double>(inside_[static_cast<std::size_t>(left - domains_.data())]);
    return left->remedy < 0 ? left_domain(*left, margin, failure)
                          : left_load(*left, margin, static_cast<double>(inside_[static_cast<std::size_t>(left->remedy)]), failure);
  }

 private:
  void go(Real s) {
    if (s > Real(0)) taylor_step(subject_.description().charts, from_, s, delta_, at_);
    subject_.begin_step(at_.t, Real(1));
  }

  /// The domain left here, preferably one that contained the motion before.  A margin may be negative where the law takes
  /// another branch, and then the forces have values.
  const Domain* find() {
    outside_before_ = outside_;
    subject_.domains(at_.q.data(), at_.v.data(), from_.lambda.data(), inside_.data());
    const Domain *first = nullptr, *left = nullptr;
    for (std::size_t i = domains_.size(); i-- > 0;) {
      outside_[i] = inside_[i] < Real(0) || (domains_[i].strict && inside_[i] <= Real(0));
      if (outside_[i]) (outside_before_[i] ? first : left) = &domains_[i];
    }
    return (first || left) && !has_forces() ? (left ? left : first) : nullptr;
  }

  bool has_forces() {
    if constexpr (requires { subject_.dynamic_residual(nullptr, nullptr, nullptr, nullptr, Real(0), nullptr, nullptr); })
      subject_.dynamic_residual(at_.q.data(), at_.v.data(), from_.vdot.data(), from_.lambda.data(), Real(0), forces_.data(), residual_.data());
    else subject_.evaluate(at_.q.data(), at_.v.data(), from_.lambda.data(), forces_.data(), residual_.data());
    return std::isfinite(static_cast<double>(largest(forces_)));
  }

  Subject& subject_;
  const List<Domain>& domains_;
  const State<Real>& from_;
  State<Real> at_;
  std::vector<Real> delta_, inside_;
  std::vector<unsigned char> outside_, outside_before_;
  std::vector<Real> forces_, residual_;
};

/// The failure of a step of length h from a state by a law without a value, if there is one; else the given failure.  Called only after a failure.
template <class Subject>
Failure explain_by_domains(Subject& subject, const State<typename Subject::real_type>& from, typename Subject::real_type h,
                           const Failure& failure) {
  if constexpr (requires { subject.domains(nullptr, nullptr, nullptr, nullptr); })
    if (failure.guards.empty() && !subject.description().domains.empty()) return Domains<Subject>(subject, from).explain(failure, h);
  return failure;
}

}  // namespace cutjoint
