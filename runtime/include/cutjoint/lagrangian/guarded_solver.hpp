// A fixed pivot order under watch: where it is unsafe, the matrix is factored again with pivoting.
#pragma once

#include <algorithm>
#include <limits>
#include <memory>
#include <utility>
#include <vector>

#include "cutjoint/lagrangian/matrix.hpp"
#include "cutjoint/lagrangian/solver.hpp"

namespace cutjoint {

/// Watches a solver whose pivot order does not depend on the values, over a matrix that is not symmetric.
///
/// The first solution of each factorisation is put into its equations.  Where these would have to change by more than 1e-8 of their scale
/// for it to solve them (the backward error), or a pivot vanished, pivots of that order are too small beside what they eliminate,
/// and a solver with pivoting takes over for this matrix.
template <class Real>
class GuardedSolver final : public LinearSolver<Real> {
 public:
  GuardedSolver(std::unique_ptr<LinearSolver<Real>> fixed, std::unique_ptr<LinearSolver<Real>> pivoting)
      : fixed_(std::move(fixed)), pivoting_(std::move(pivoting)) {}

  void analyse(const Pattern& pattern) override {
    pattern_ = &pattern;
    scaled_ = std::make_unique<Scaled<Real>>(pattern);
    right_.resize(static_cast<std::size_t>(pattern.size));
    fixed_->analyse(pattern);
  }

  Breakdown factor(const Real* values) override {
    values_ = values;
    in_use_ = fixed_.get();
    trusted_ = false;
    if (!fixed_->factor(values)) return {};
    return fall_back();
  }

  Breakdown solve(Real* x) override {
    if (trusted_) return in_use_->solve(x);
    std::copy_n(x, right_.size(), right_.begin());
    if (const Breakdown broken = in_use_->solve(x)) return broken;
    trusted_ = solves(x);
    if (trusted_) return {};
    if (in_use_ == pivoting_.get()) return {Breakdown::Kind::singular, -1};
    if (const Breakdown broken = fall_back()) return broken;
    std::copy(right_.begin(), right_.end(), x);
    if (const Breakdown broken = in_use_->solve(x)) return broken;
    trusted_ = solves(x);
    return trusted_ ? Breakdown{} : Breakdown{Breakdown::Kind::singular, -1};
  }

  long fallbacks() const override { return fallbacks_; }

 private:
  /// The scales are those of an earlier matrix of the run until they find fault.
  bool solves(const Real* x) {
    const Real limit = std::max(Real(1e-8), 128 * std::numeric_limits<Real>::epsilon());
    if (measured_ && scaled_->backward_error(values_, x, right_.data()) <= limit) return true;
    measured_ = true;
    scaled_->measure(values_);
    return scaled_->backward_error(values_, x, right_.data()) <= limit;
  }

  Breakdown fall_back() {
    if (fallbacks_++ == 0) pivoting_->analyse(*pattern_);
    in_use_ = pivoting_.get();
    return pivoting_->factor(values_);
  }

  std::unique_ptr<LinearSolver<Real>> fixed_, pivoting_;
  const Pattern* pattern_ = nullptr;
  const Real* values_ = nullptr;
  std::unique_ptr<Scaled<Real>> scaled_;
  std::vector<Real> right_;
  LinearSolver<Real>* in_use_ = nullptr;
  bool trusted_ = false, measured_ = false;
  long fallbacks_ = 0;
};

}  // namespace cutjoint
