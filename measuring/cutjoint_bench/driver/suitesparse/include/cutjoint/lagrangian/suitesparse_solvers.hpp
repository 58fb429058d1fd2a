// The solvers of SuiteSparse, for comparison: CHOLMOD, KLU and UMFPACK.  They are not under this project's licence (UMFPACK and parts of
// CHOLMOD are under the GPL), so that only a simulator built for comparison has them.
#pragma once

#include <cholmod.h>
#include <klu.h>
#include <umfpack.h>

#include <algorithm>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "cutjoint/lagrangian/matrix.hpp"
#include "cutjoint/lagrangian/solver.hpp"

namespace cutjoint {

/// CHOLMOD: simplicial L D L^T or supernodal L L^T as it decides; analysed once, refactored in place.
class Cholmod final : public LinearSolver<double> {
 public:
  Cholmod() {
    cholmod_start(&common_);
    common_.print = 0;
  }

  Cholmod(const Cholmod&) = delete;
  Cholmod& operator=(const Cholmod&) = delete;

  ~Cholmod() override {
    cholmod_free_factor(&factor_, &common_);
    for (cholmod_dense** dense : {&solution_, &work_, &more_work_}) cholmod_free_dense(dense, &common_);
    cholmod_finish(&common_);
  }

  void analyse(const Pattern& pattern) override {
    matrix_.nrow = matrix_.ncol = static_cast<std::size_t>(pattern.size);
    matrix_.nzmax = pattern.row.size();
    matrix_.p = const_cast<int*>(pattern.first.data());  // CHOLMOD does not write into a matrix
    matrix_.i = const_cast<int*>(pattern.row.data());
    matrix_.stype = -1;  // the lower triangle
    matrix_.itype = CHOLMOD_INT;
    matrix_.xtype = CHOLMOD_PATTERN;  // no values yet
    matrix_.dtype = CHOLMOD_DOUBLE;
    matrix_.sorted = matrix_.packed = 1;
    factor_ = cholmod_analyze(&matrix_, &common_);
    require_fine();
    matrix_.xtype = CHOLMOD_REAL;
    right_.nrow = right_.nzmax = right_.d = matrix_.nrow;
    right_.ncol = 1;
    right_.xtype = CHOLMOD_REAL;
    right_.dtype = CHOLMOD_DOUBLE;
  }

  Breakdown factor(const double* values) override {
    matrix_.x = const_cast<double*>(values);
    cholmod_factorize(&matrix_, factor_, &common_);
    require_fine();
    if (common_.status == CHOLMOD_NOT_POSDEF) return not_positive(factor_->minor);
    return factor_->is_ll ? Breakdown{} : first_not_positive();
  }

  Breakdown solve(double* x) override {
    right_.x = x;
    cholmod_solve2(CHOLMOD_A, factor_, &right_, nullptr, &solution_, nullptr, &work_, &more_work_, &common_);
    std::copy_n(static_cast<const double*>(solution_->x), right_.nrow, x);
    return {};
  }

 private:
  /// Errors, such as no memory left; what is wrong with a matrix is only a warning.
  void require_fine() const {
    if (common_.status < CHOLMOD_OK) throw std::runtime_error("CHOLMOD ends with status " + std::to_string(common_.status));
  }

  /// A simplicial L D L^T goes through negative pivots silently; D is the first entry of each column.
  Breakdown first_not_positive() const {
    const auto* first = static_cast<const int*>(factor_->p);
    const auto* entries = static_cast<const double*>(factor_->x);
    for (std::size_t j = 0; j < factor_->n; ++j)
      if (!(entries[first[j]] > 0.0)) return not_positive(j);
    return {};
  }

  Breakdown not_positive(std::size_t pivot) const {
    return {Breakdown::Kind::not_positive, pivot < factor_->n ? static_cast<const int*>(factor_->Perm)[pivot] : -1};
  }

  cholmod_common common_{};
  cholmod_sparse matrix_{};
  cholmod_factor* factor_ = nullptr;
  cholmod_dense right_{};
  cholmod_dense *solution_ = nullptr, *work_ = nullptr, *more_work_ = nullptr;
};

/// KLU: its pivots are chosen at the first factorisation and reused while they are large enough.
class Klu final : public LinearSolver<double> {
 public:
  Klu() { klu_defaults(&common_); }

  Klu(const Klu&) = delete;
  Klu& operator=(const Klu&) = delete;

  ~Klu() override {
    klu_free_numeric(&numeric_, &common_);
    klu_free_symbolic(&symbolic_, &common_);
  }

  void analyse(const Pattern& pattern) override {
    whole_.emplace(pattern);
    values_.resize(whole_->pattern().row.size());
    symbolic_ = klu_analyze(pattern.size, first(), row(), &common_);
  }

  Breakdown factor(const double* values) override {
    if (symbolic_ == nullptr) return {Breakdown::Kind::singular, -1};
    whole_->fill(values, values_.data());
    if (numeric_ != nullptr) {
      if (refactored()) return {};
      ++fallbacks_;
    }
    return factored() ? Breakdown{} : Breakdown{Breakdown::Kind::singular, common_.singular_col < symbolic_->n ? common_.singular_col : -1};
  }

  Breakdown solve(double* x) override {
    klu_solve(symbolic_, numeric_, symbolic_->n, 1, x, &common_);
    return {};
  }

  long fallbacks() const override { return fallbacks_; }

 private:
  /// Choose pivots anew.
  bool factored() {
    klu_free_numeric(&numeric_, &common_);
    numeric_ = klu_factor(first(), row(), values_.data(), symbolic_, &common_);
    if (numeric_ == nullptr || common_.status != KLU_OK) return false;
    klu_rcond(symbolic_, numeric_, &common_);
    condition_ = common_.rcond;
    return true;
  }

  /// Keep the pivots; false when they became too small beside what they eliminate (growth) or beside each other (condition).
  bool refactored() {
    if (klu_refactor(first(), row(), values_.data(), symbolic_, numeric_, &common_) == 0 || common_.status != KLU_OK) return false;
    klu_rcond(symbolic_, numeric_, &common_);
    if (!(common_.rcond >= 1e-4 * condition_)) return false;
    klu_rgrowth(first(), row(), values_.data(), symbolic_, numeric_, &common_);
    return common_.rgrowth >= 1e-6;
  }

  int* first() { return const_cast<int*>(whole_->pattern().first.data()); }  // KLU does not write into a matrix
  int* row() { return const_cast<int*>(whole_->pattern().row.data()); }

  klu_common common_{};
  std::optional<WholeMatrix> whole_;
  std::vector<double> values_;
  klu_symbolic* symbolic_ = nullptr;
  klu_numeric* numeric_ = nullptr;
  double condition_ = 0.0;
  long fallbacks_ = 0;
};

/// UMFPACK: symbolic analysis once, pivots in each factorisation; no iterative refinement, which the other solvers do not have either.
class Umfpack final : public LinearSolver<double> {
 public:
  Umfpack() {
    umfpack_di_defaults(control_);
    control_[UMFPACK_IRSTEP] = 0;
  }

  Umfpack(const Umfpack&) = delete;
  Umfpack& operator=(const Umfpack&) = delete;

  ~Umfpack() override {
    umfpack_di_free_numeric(&numeric_);
    umfpack_di_free_symbolic(&symbolic_);
  }

  void analyse(const Pattern& pattern) override {
    whole_.emplace(pattern);
    values_.resize(whole_->pattern().row.size());
    right_.resize(static_cast<std::size_t>(pattern.size));
    work_.resize(right_.size());
    indices_.resize(right_.size());
    umfpack_di_symbolic(pattern.size, pattern.size, first(), row(), nullptr, &symbolic_, control_, nullptr);
  }

  Breakdown factor(const double* values) override {
    whole_->fill(values, values_.data());
    umfpack_di_free_numeric(&numeric_);
    const int status = umfpack_di_numeric(first(), row(), values_.data(), symbolic_, &numeric_, control_, nullptr);
    return status == UMFPACK_OK ? Breakdown{} : Breakdown{Breakdown::Kind::singular, -1};
  }

  Breakdown solve(double* x) override {
    std::copy_n(x, right_.size(), right_.begin());
    umfpack_di_wsolve(UMFPACK_A, first(), row(), values_.data(), x, right_.data(), numeric_, control_, nullptr, indices_.data(),
                      work_.data());
    return {};
  }

 private:
  const int* first() const { return whole_->pattern().first.data(); }
  const int* row() const { return whole_->pattern().row.data(); }

  std::optional<WholeMatrix> whole_;
  std::vector<double> values_, right_, work_;
  std::vector<int> indices_;
  void *symbolic_ = nullptr, *numeric_ = nullptr;
  double control_[UMFPACK_CONTROL];
};

}  // namespace cutjoint
