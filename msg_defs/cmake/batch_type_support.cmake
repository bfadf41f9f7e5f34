# Compiles the generated C++ type support in batches of sources: by itself, each source reads the same headers again,
# which takes most of the time to build an interface package. Call it after rosidl_generate_interfaces().
function(batch_type_support)
  foreach(kind cpp fastrtps_c fastrtps_cpp)
    set(library ${PROJECT_NAME}__rosidl_typesupport_${kind})
    if(TARGET ${library})
      set_target_properties(${library} PROPERTIES UNITY_BUILD ON)
      if(NOT MSVC)
        target_compile_options(${library} PRIVATE -Wno-redundant-decls)  # sources of a batch repeat declarations
      endif()
    endif()
  endforeach()
endfunction()
