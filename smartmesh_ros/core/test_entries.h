// Entries of the core for tests alone.
#pragma once

#include <nanobind/nanobind.h>

namespace smartmesh {

// Adds `Shape` and `find_contacts` to the module.
void add_test_entries(nanobind::module_& m);

}  // namespace smartmesh
