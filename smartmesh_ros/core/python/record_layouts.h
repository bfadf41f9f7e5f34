// Layouts of records that Python shares, for NumPy's types: no field can be mistaken for another.
#pragma once

#include <string>
#include <tuple>
#include <type_traits>
#include <vector>

#include "map/motion.h"

namespace smartmesh {

// A field: its name, 'f' = numbers of double precision or 'i' = whole ones, how many, and its place [bytes].
using FieldLayout = std::tuple<std::string, std::string, std::size_t, std::size_t>;

template <class Record, class Field>
FieldLayout field(const char* name, Field Record::*member) {
  static_assert(sizeof(Field) % 8 == 0, "numbers of eight bytes");
  const Record record{};
  const auto* at = reinterpret_cast<const char*>(&(record.*member));
  constexpr bool is_whole = std::is_integral_v<Field> || std::is_enum_v<Field>;
  return {name, is_whole ? "i" : "f", sizeof(Field) / 8,
          static_cast<std::size_t>(at - reinterpret_cast<const char*>(&record))};
}

inline std::vector<FieldLayout> clock_layout() {
  return {field("time", &Clock::time),         field("opened", &Clock::opened),  field("lifetime", &Clock::lifetime),
          field("delay", &Clock::delay),       field("middle", &Clock::middle),  field("middle_1", &Clock::middle_1),
          field("middle_2", &Clock::middle_2), field("since", &Clock::since),    field("until", &Clock::until),
          field("known", &Clock::known),       field("newest", &Clock::newest),  field("intervals", &Clock::intervals),
          field("count", &Clock::count),       field("updates", &Clock::updates)};
}

}  // namespace smartmesh
