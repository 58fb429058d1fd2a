// Texts of numbers beside those of std::to_chars: random bits, random sizes, short decimals and their neighbours, integers, and what is no finite number.
#include "cutjoint/shortest_text.hpp"

#include <iostream>
#include <limits>
#include <random>
#include <string>
#include <string_view>

namespace {

long checked = 0, different = 0;

void check(double value) {
  char own[cutjoint::ShortestText::longest], other[cutjoint::ShortestText::longest];
  const std::string_view text(own, static_cast<std::size_t>(cutjoint::ShortestText::write(own, value) - own));
  const std::string_view expected(other, static_cast<std::size_t>(std::to_chars(other, other + sizeof other, value).ptr - other));
  ++checked;
  if (text != expected && different++ < 10) std::cerr << text << " for " << expected << '\n';
}

}  // namespace

int main() {
  std::mt19937_64 random(1);
  const auto of = [&random](std::uint64_t size) { return random() % size; };
  for (int i = 0; i < 40000; ++i) {
    check(std::bit_cast<double>(random()));
    const std::uint64_t exponent = (890 + of(200)) << 52;
    check(std::bit_cast<double>(exponent | random() >> 12 | random() >> 63 << 63));
    check(std::bit_cast<double>(exponent | of(3)));  // powers of 2 and what is next to them
    check(std::bit_cast<double>(exponent | ((std::uint64_t{1} << 52) - 1 - of(3))));
    check(static_cast<double>(random() >> of(64)));
    check(static_cast<double>(random() >> 11) / static_cast<double>(1 << of(20)));
    for (const std::uint64_t digits : {of(10), of(100000), of(10000000000000000)}) {
      const double value = std::stod(std::to_string(digits) + "e-" + std::to_string(of(40)));
      for (const double side : {value, std::nextafter(value, 1e300), std::nextafter(value, -1.0)}) check(side);
    }
  }
  for (const double value : {0.0, -0.0, 1e300, 5e-324, std::numeric_limits<double>::infinity(), -std::numeric_limits<double>::infinity(),
                             std::numeric_limits<double>::quiet_NaN()})
    check(value);
  std::cout << checked << ' ' << different << '\n';
}
