// Arrays that take memory where they were written to.
#pragma once

#include <cstddef>
#include <new>

#include <sys/mman.h>

namespace smartmesh {

// Numbers that are zero at first. Pages are small: the first write to a huge page allocates 2 MiB, and the kernel may
// need 10 ms and more to compact memory for it.
template <class T>
class Untouched {
 public:
  explicit Untouched(std::size_t count) : count_(count) {
    void* found = mmap(nullptr, count * sizeof(T), PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
    if (found == MAP_FAILED) throw std::bad_alloc();
#ifdef MADV_NOHUGEPAGE
    madvise(found, count * sizeof(T), MADV_NOHUGEPAGE);
#endif
    data_ = static_cast<T*>(found);
  }
  ~Untouched() { munmap(data_, count_ * sizeof(T)); }
  Untouched(const Untouched&) = delete;
  Untouched& operator=(const Untouched&) = delete;

  T* data() const { return data_; }

 private:
  std::size_t count_;
  T* data_;
};

}  // namespace smartmesh
