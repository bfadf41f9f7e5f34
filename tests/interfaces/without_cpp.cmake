# The tests use these messages from Python alone: leaves out the generators of C++. Include it after find_package().
list(FILTER AMENT_EXTENSIONS_rosidl_generate_idl_interfaces EXCLUDE REGEX cpp)
