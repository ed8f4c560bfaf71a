# Says where the package goes: `python_dir`, below the prefix, which is known when it is installed.
if(wheel)
  # With the libraries beside the module, each under the name that it is looked for.
  set(python_dir .)
  foreach(library IN LISTS libraries)
    get_filename_component(name ${library} NAME)
    file(MAKE_DIRECTORY ${CMAKE_INSTALL_PREFIX}/bocst)
    file(COPY_FILE ${library} ${CMAKE_INSTALL_PREFIX}/bocst/${name})
    file(RPATH_REMOVE FILE ${CMAKE_INSTALL_PREFIX}/bocst/${name})
  endforeach()
elseif(NOT python_dir)
  # Debian's interpreter looks elsewhere than others do.
  set(python_dir lib/python${version}/site-packages)
  if(interpreter MATCHES "^/usr/bin/" AND CMAKE_INSTALL_PREFIX STREQUAL "/usr")
    set(python_dir lib/python3/dist-packages)
  elseif(interpreter MATCHES "^/usr/bin/" AND CMAKE_INSTALL_PREFIX STREQUAL "/usr/local")
    set(python_dir lib/python${version}/dist-packages)
  endif()
endif()
