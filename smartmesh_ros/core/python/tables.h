// Arrays that Python gives to the core or takes from it. nanobind refuses those of another type or shape.
#pragma once

#include <array>
#include <cstdint>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>

namespace smartmesh {

namespace nb = nanobind;

// An array in C order, not copied, which a processor may read as its numbers: no view of bytes at odd addresses.
template <class Any>
struct Aligned : Any {
  using Base = Any;
  Aligned() = default;
  explicit Aligned(Any array) : Any(std::move(array)) {}
};

// `T` is const where the core only reads.
template <class T, std::size_t N>
using Array = Aligned<nb::ndarray<T, nb::ndim<N>, nb::c_contig, nb::device::cpu>>;

// The numbers of a record: of one number itself, where char is a flag, else of double precision.
template <class Record>
std::conditional_t<std::is_arithmetic_v<Record>, Record, double> number_of(const Record&);
template <class T, std::size_t N>
T number_of(const std::array<T, N>&);
bool number_of(const char&);

template <class Record>
struct Layout {
  using Number = decltype(number_of(std::declval<const Record&>()));
  static constexpr std::size_t COLUMNS = sizeof(Record) / sizeof(Number);
  using Shape = std::conditional_t<COLUMNS == 1, nb::shape<-1>, nb::shape<-1, COLUMNS>>;
};

template <class Record, class Of = Layout<std::remove_const_t<Record>>>
using RecordArray =
    Aligned<nb::ndarray<std::conditional_t<std::is_const_v<Record>, const typename Of::Number, typename Of::Number>,
                        typename Of::Shape, nb::c_contig, nb::device::cpu>>;

// Records of Python's: numbers (n,), or (n, k) for records of k numbers.
template <class Record>
struct Rows : RecordArray<Record> {
  using RecordArray<Record>::RecordArray;
  Record* data() const { return reinterpret_cast<Record*>(RecordArray<Record>::data()); }
  auto* numbers() const { return RecordArray<Record>::data(); }
  std::size_t size() const { return this->shape(0); }
  Record& operator[](std::size_t k) const { return data()[k]; }
  Record* begin() const { return data(); }
  Record* end() const { return data() + size(); }
};

// One record of Python's, an array of some sizes.
template <class Record, nb::ssize_t... Sizes>
struct One : Aligned<nb::ndarray<const double, nb::shape<Sizes...>, nb::c_contig, nb::device::cpu>> {
  static_assert(sizeof(Record) == (Sizes * ...) * sizeof(double));
  using One::Aligned::Aligned;
  const Record& operator*() const { return *operator->(); }
  const Record* operator->() const { return reinterpret_cast<const Record*>(this->data()); }
};

using Doubles1 = Rows<const double>;
using Slots = Rows<const std::int64_t>;
using Flags = Rows<const bool>;

// Refuses arrays that have not `count` rows each.
template <class... Arrays>
void check_counts(std::size_t count, const Arrays&... arrays) {
  if (((arrays.shape(0) != count) || ...))
    throw std::invalid_argument("arrays that go together must have " + std::to_string(count) + " rows each");
}

// Refuses slots that are not all in tables of `count` rows.
inline const Slots& slots_below(const Slots& slots, std::size_t count) {
  for (const std::int64_t slot : slots)
    if (slot < 0 || slot >= static_cast<std::int64_t>(count))
      throw std::invalid_argument("a slot is not in the tables");
  return slots;
}

// Returns records as an array of Python's, as `Rows` has them.
template <class Record>
auto array_of(std::vector<Record> records) {
  using Of = Layout<Record>;
  using Made = nb::ndarray<nb::numpy, typename Of::Number, typename Of::Shape>;
  auto* kept = new std::vector<Record>(std::move(records));
  kept->reserve(1);  // an array without rows has an address, too
  nb::capsule owner(kept, [](void* p) noexcept { delete static_cast<std::vector<Record>*>(p); });
  if constexpr (Of::COLUMNS == 1)
    return Made(kept->data(), {kept->size()}, owner);
  else
    return Made(kept->data(), {kept->size(), Of::COLUMNS}, owner);
}

}  // namespace smartmesh

namespace nanobind::detail {

template <class Array>
struct type_caster<Array, enable_if_t<std::is_base_of_v<smartmesh::Aligned<typename Array::Base>, Array>>> {
  NB_TYPE_CASTER(Array, const_name("aligned ") + make_caster<typename Array::Base>::Name)

  bool from_python(handle source, std::uint32_t flags, cleanup_list* cleanup) noexcept {
    make_caster<typename Array::Base> found;
    if (!found.from_python(source, flags & ~static_cast<std::uint32_t>(cast_flags::convert), cleanup)) return false;
    value = Array(std::move(found.value));
    return reinterpret_cast<std::uintptr_t>(value.data()) % sizeof(typename Array::Base::Scalar) == 0;
  }
};

}  // namespace nanobind::detail
