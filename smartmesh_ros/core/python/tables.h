// Tables with a row for each slot of a body, which Python gives to the core or takes from it.
#pragma once

#include <array>
#include <vector>

#include "python/bindings.h"

namespace smartmesh {

using Doubles1 = Array<const double, 1>;
using Slots1 = std::vector<std::int64_t>;

// Returns slots, all of which are in tables of `count` rows.
inline Slots1 slots_below(const Slots& slots, std::size_t count) {
  check_alignment(slots.data(), sizeof(std::int64_t));
  for (std::size_t k = 0; k < slots.shape(0); ++k)
    if (slots.data()[k] < 0 || slots.data()[k] >= static_cast<std::int64_t>(count))
      throw std::invalid_argument("a slot is not in the tables");
  return {slots.data(), slots.data() + slots.shape(0)};
}

// Returns a new array for Python, which owns it.
template <class T, std::size_t N>
nb::ndarray<nb::numpy, T, nb::ndim<N>> new_array(const std::array<std::size_t, N>& shape) {
  std::size_t size = 1;
  for (std::size_t count : shape) size *= count;
  T* data = new T[std::max<std::size_t>(size, 1)]();
  nb::capsule owner(data, [](void* p) noexcept { delete[] static_cast<T*>(p); });
  return nb::ndarray<nb::numpy, T, nb::ndim<N>>(data, N, shape.data(), owner);
}

// Returns a new array with the values of a list.
template <class T, std::size_t N>
auto array_of(const std::vector<T>& values, const std::array<std::size_t, N>& shape) {
  auto made = new_array<T, N>(shape);
  std::copy(values.begin(), values.end(), made.data());
  return made;
}

using NewTable = nb::ndarray<nb::numpy, double, nb::ndim<2>>;
using NewFlags = nb::ndarray<nb::numpy, bool, nb::ndim<1>>;

// Returns records of doubles as the rows of a new table.
template <class Record>
NewTable table_of(const std::vector<Record>& rows) {
  NewTable made = new_array<double, 2>({rows.size(), sizeof(Record) / sizeof(double)});
  std::copy(rows.begin(), rows.end(), reinterpret_cast<Record*>(made.data()));
  return made;
}

}  // namespace smartmesh
