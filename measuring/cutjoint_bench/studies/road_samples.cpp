// The time that a sample of a road takes, in turns: one wheel that rolls over a profile of twenty pieces and over a surface.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <vector>

#include "cutjoint/core/roads/road.hpp"

namespace {

using cutjoint::Road;

constexpr int samples = 1'000'000, rounds = 9;
double kept = 0.0;

/// Nanoseconds a sample of one round.
template <class Sample>
double time_of(Sample sample) {
  const auto begin = std::chrono::steady_clock::now();
  for (int i = 0; i < samples; ++i) kept += sample(2e-5 * i, 0.7 + 1e-7 * i);
  return std::chrono::duration<double, std::nano>(std::chrono::steady_clock::now() - begin).count() / samples;
}

}  // namespace

int main() {
  std::vector<double> heights(2048 * 81), breaks;
  for (std::size_t i = 0; i < heights.size(); ++i) heights[i] = 0.01 * std::sin(0.37 * double(i));
  std::vector<cutjoint::Piece<double>> pieces;
  for (int i = 0; i < 20; ++i) {
    pieces.push_back({i % 2 ? cutjoint::PieceKind::cosine : cutjoint::PieceKind::line, double(i), 0.0, 0.01, 6.28});
    if (i) breaks.push_back(i);
  }
  const cutjoint::FrictionPatch<double> patches[] = {{{1.0, 2.0}, {-1.0, 1.0}, 0.5, 0.1}};
  const cutjoint::Surface<double> surface{
      .field = {.start = {0.0, -2.0}, .step = {0.05, 0.05}, .counts = {2048, 81}, .wraps = true, .bilinear = false, .heights = heights}, .patches = patches};
  cutjoint::Surface<double> flat = surface;
  flat.field.bilinear = true;
  const cutjoint::Track<double> track{pieces, breaks};
  const Road<double> road(track, track, false, &surface), linear(track, track, false, &flat);
  double least[5] = {1e9, 1e9, 1e9, 1e9, 1e9};
  for (int round = 0; round < rounds; ++round) {
    const double now[] = {time_of([&](double x, double y) { return road.height(x, y); }), time_of([&](double x, double y) { return road.surface(x, y, 0, 0); }),
                          time_of([&](double x, double y) { return road.surface(x, y, 1, 0); }), time_of([&](double x, double y) { return linear.surface(x, y, 0, 0); }),
                          time_of([&](double x, double y) { return road.friction(x, y, 0, 0); })};
    for (int i = 0; i < 5; ++i) least[i] = std::min(least[i], now[i]);
  }
  std::printf("{\"height of a profile\": %g, \"height of a surface\": %g, \"slope of a surface\": %g, \"height, bilinear\": %g, \"friction\": %g}\n", least[0],
              least[1], least[2], least[3], least[4]);
  return std::isnan(kept);
}
