// The elimination of the joints, played through once on the body graph: which couplings meet which, and where they are stored.
#pragma once

#include <algorithm>
#include <map>
#include <optional>
#include <utility>
#include <vector>

#include "cutjoint/generic/model.hpp"

namespace cutjoint::generic {

/// A coupling C_ij of node i with `body`, a body or another node: a slot, or its transpose.
struct Link {
  int body, slot;
  bool transposed;
};

/// The place to which a coupling is added: none (with the ground), a body's own matrix (of a body with itself), a slot or its transpose.
struct Target {
  enum class Kind { nothing, diagonal, slot };
  Kind kind = Kind::nothing;
  int index = -1;
  bool transposed = false;
};

/// The way in which a joint's unknowns are eliminated.
enum class Pivot { none, scalars, free_root, ball };

/// The elimination of one body.  `coupled` are its couplings, `inherited` those of its parent with the same bodies.  `rows` are the bodies
/// on which its own acceleration comes to depend, stored from `first_row` on; the parent's is `parent_row`, -1 where there is none.
/// `fills` are the couplings between the rows' bodies, for each row those with the later ones.  The unknowns of a geared joint are a node,
/// whose couplings are `own`, in the rows `own_rows`; `self` is that of the body with this node.
struct Elimination {
  Pivot pivot = Pivot::none;
  std::vector<Link> coupled, own;
  std::optional<Link> self;
  std::vector<int> own_rows;
  std::vector<Target> inherited, fills;
  std::vector<int> rows;
  int first_row = 0, parent_row = -1;
};

struct Plan {
  std::vector<Target> closures;            ///< couplings of follower and base of each cut joint
  std::vector<Target> gears;               ///< couplings of both joints' unknowns of each gear
  std::vector<Elimination> eliminations;   ///< by body
  std::size_t slots = 0, rows = 0;
};

/// Makes the plan of a model; bodies are eliminated in reverse order.
class Planner {
 public:
  template <class Real>
  Plan plan(const Model<Real>& model) {
    for (const Cut& cut : model.cuts) plan_.closures.push_back(couple(cut.follower.body, cut.base.body));
    for (const Gear& gear : model.gears) plan_.gears.push_back(couple(model, gear));
    plan_.eliminations.resize(model.bodies.size());
    for (int i = static_cast<int>(model.bodies.size()) - 1; i > ground; --i) eliminate(i, model.body(i));
    return std::move(plan_);
  }

 private:
  static Pivot pivot_of(const Body& body) {
    if (body.speeds == 0) return Pivot::none;
    if (body.joint.is_ball()) return Pivot::ball;
    return body.free_root() ? Pivot::free_root : Pivot::scalars;
  }

  void eliminate(int i, const Body& body) {
    Elimination& e = plan_.eliminations[static_cast<std::size_t>(i)];
    e.pivot = pivot_of(body);
    e.coupled = links(i);
    if (body.node >= 0) e.own = links(body.node);
    e.self = split(e.coupled, body.node);
    split(e.own, i);
    if (e.pivot != Pivot::none) choose_rows(e, body.parent);
    for (const Link& link : e.coupled) e.inherited.push_back(couple(body.parent, link.body));
    for (std::size_t j = 0; j < e.rows.size(); ++j)
      for (std::size_t k = j + 1; k < e.rows.size(); ++k) e.fills.push_back(couple(e.rows[j], e.rows[k]));
    const auto is_gone = [i, &body](int node) { return node == i || node == body.node; };
    std::erase_if(open_, [&](const auto& entry) { return is_gone(entry.first.first) || is_gone(entry.first.second); });
  }

  template <class Real>
  Target couple(const Model<Real>& model, const Gear& gear) {
    const int first = model.body(gear.terms[0].body).node, last = model.body(gear.terms[1].body).node;
    return first < 0 || last < 0 ? Target{} : couple(first, last);  // a guided joint has no unknowns
  }

  /// The coupled bodies, what the joint's own unknowns are coupled to, then the parent; a ball passes on to its parent by a formula of its own.
  void choose_rows(Elimination& e, int parent) {
    for (const Link& link : e.coupled) e.rows.push_back(link.body);
    for (const Link& link : e.own) e.own_rows.push_back(row_of(e, link.body));
    if (e.pivot != Pivot::ball && parent != ground) e.parent_row = row_of(e, parent);
    e.first_row = static_cast<int>(plan_.rows);
    plan_.rows += e.rows.size();
  }

  /// The row of a node, a new one if it has none.
  static int row_of(Elimination& e, int node) {
    const auto found = std::find(e.rows.begin(), e.rows.end(), node);
    const int row = static_cast<int>(found - e.rows.begin());
    if (found == e.rows.end()) e.rows.push_back(node);
    return row;
  }

  /// Takes the link to a node out of a list.
  static std::optional<Link> split(std::vector<Link>& list, int node) {
    const auto found = std::find_if(list.begin(), list.end(), [node](const Link& link) { return link.body == node; });
    if (found == list.end()) return {};
    const Link link = *found;
    list.erase(found);
    return link;
  }

  /// A node's couplings in the order in which they came to be.
  std::vector<Link> links(int i) const {
    std::map<int, Link> found;
    for (const auto& [bodies, slot] : open_) {
      if (bodies.first == i) found[slot] = {bodies.second, slot, false};
      if (bodies.second == i) found[slot] = {bodies.first, slot, true};
    }
    std::vector<Link> list;
    for (const auto& [slot, link] : found) list.push_back(link);
    return list;
  }

  Target couple(int i, int j) {
    if (i == ground || j == ground) return {};
    if (i == j) return {Target::Kind::diagonal, i, false};
    const auto reverse = open_.find({j, i});
    if (reverse != open_.end()) return {Target::Kind::slot, reverse->second, true};
    const auto [entry, is_new] = open_.try_emplace({i, j}, static_cast<int>(plan_.slots));
    if (is_new) ++plan_.slots;
    return {Target::Kind::slot, entry->second, false};
  }

  Plan plan_;
  std::map<std::pair<int, int>, int> open_;  ///< slots of the couplings between nodes that are not yet eliminated
};

}  // namespace cutjoint::generic
