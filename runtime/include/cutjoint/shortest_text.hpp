// The shortest decimal text of a double that reads back as the same one.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <cstring>

namespace cutjoint {

/// Writes a number as std::to_chars does, byte for byte, by a third of its instructions.
///
/// After Giulietti's Schubfach: multiplied by the power of ten that makes its ulp 1 to 10, a number has an integer nearest to it, and at most one multiple of 10, that read
/// back as it.  10^n is exact in 128 bits up to n = 55, which is enough from 1e-37 to 2^53.  std::to_chars writes all others, powers of 2, and what 60 bits behind the point
/// do not decide.
class ShortestText {
 public:
  static constexpr std::size_t longest = 64;  ///< the bytes that a text has room for

  /// The end of the text.
  static char* write(char* text, double value) {
#ifdef __SIZEOF_INT128__
    if constexpr (std::endian::native == std::endian::little) {
      const double size = std::abs(value);
      if (size >= 1e-37 && size < 0x1p53)
        if (const Decimal found = nearest(std::bit_cast<std::uint64_t>(size)); found.digits != 0) {
          *text = '-';
          return lay_out(text + (value < 0.0), found);
        }
    }
#endif
    return std::to_chars(text, text + longest, value).ptr;
  }

 private:
#ifdef __SIZEOF_INT128__
  __extension__ using Wide = unsigned __int128;

  /// digits of 16 or 17 places, times 10^exponent; digits are 0 where it was not decided.
  struct Decimal {
    std::uint64_t digits;
    int exponent;
  };

  static constexpr auto powers_ = [] {  // 10^n, the first bit the highest of 128
    std::array<Wide, 56> found{};
    Wide five = 1;
    for (Wide& power : found) {
      power = five;
      while (!(power >> 127)) power <<= 1;
      five *= 5;
    }
    return found;
  }();

  static Decimal nearest(std::uint64_t bits) {
    constexpr std::uint64_t hidden = std::uint64_t{1} << 52;
    const std::uint64_t c = (bits & (hidden - 1)) | hidden;
    const int q = static_cast<int>(bits >> 52) - 1075, exponent = (q * 1262611) >> 22, n = -exponent;  // floor of the logarithm of 2^q
    const int shift = q + ((n * 1741647) >> 19);                                                       // the ulp is power 2^(shift - 127)
    if (c == hidden || n <= 0) return {};
    const Wide power = powers_[static_cast<std::size_t>(n)];
    const std::uint64_t factor = c << (shift + 1);
    const std::uint64_t high = static_cast<std::uint64_t>(power >> 64);
    const Wide x = Wide{factor} * high + ((Wide{factor} * static_cast<std::uint64_t>(power)) >> 64);
    const std::uint64_t whole = static_cast<std::uint64_t>(x >> 64), rest = static_cast<std::uint64_t>(x) >> 4, tens = whole / 10, half = high >> (4 - shift);
    // in units of 2^-60, of which `above` and `half` lack less than 1 each
    const std::uint64_t above = (whole - 10 * tens) << 60 | rest, below = (std::uint64_t{10} << 60) - above, nearer = std::min(above, below);
    if (nearer + 2 <= half) return {10 * (tens + (below < above)), exponent};
    constexpr std::uint64_t middle = std::uint64_t{1} << 59;
    if (nearer <= half + 2 || rest - (middle - 2) <= 4) return {};
    return {whole + (rest > middle), exponent};
  }

  /// Eight digits, the first in the lowest byte.
  static std::uint64_t spread(std::uint64_t number) {
    const std::uint64_t fours = number / 10000 | (number % 10000) << 32;
    const std::uint64_t hundreds = ((fours * 10486) >> 20) & 0x7f0000007f, twos = hundreds | (fours - 100 * hundreds) << 16;
    const std::uint64_t tens = ((twos * 103) >> 10) & 0x000f000f000f000f;
    return tens | (twos - 10 * tens) << 8;
  }

  static char* lay_out(char* text, Decimal number) {
    constexpr std::uint64_t zeros = 0x3030303030303030;
    const std::uint64_t upper = number.digits / 100000000, first = upper / 100000000, middle = spread(upper - 100000000 * first), last = spread(number.digits - 100000000 * upper);
    const std::uint64_t words[] = {middle | zeros, last | zeros, zeros, zeros};
    std::array<char, 40> digits;
    digits[0] = static_cast<char>('0' + first);
    std::memcpy(digits.data() + (first != 0), words, sizeof words);
    const int all = 16 + (first != 0), behind = last != 0 ? std::countl_zero(last) / 8 : 8 + std::countl_zero(middle) / 8, length = all - behind;
    const int exponent = number.exponent + behind, point = length + exponent;  // places before the point
    if (exponent > 0 ? exponent > 5 - (length == 1) : -exponent > length + 3 - (length == 1)) return write_scientific(text, digits.data(), length, point - 1);
    if (point <= 0) {
      std::memcpy(text, "0.0000000000000000000000", 24);
      std::memcpy(text + 2 - point, digits.data(), 24);
      return text + 2 - point + length;
    }
    std::memcpy(text, digits.data(), 24);
    if (exponent >= 0) return text + point;
    std::memcpy(text + point + 1, digits.data() + point, 16);
    text[point] = '.';
    return text + length + 1;
  }

  static char* write_scientific(char* text, const char* digits, int length, int exponent) {
    text[0] = digits[0];
    std::memcpy(text + 2, digits + 1, 24);
    text[1] = '.';
    char* end = text + (length == 1 ? 1 : length + 1);
    const int size = std::abs(exponent);
    const char tail[] = {'e', exponent < 0 ? '-' : '+', static_cast<char>('0' + size / 10), static_cast<char>('0' + size % 10)};
    std::memcpy(end, tail, 4);
    return end + 4;
  }
#endif
};

}  // namespace cutjoint
