# Debian packages: `cpack -G DEB` in the build folder. Configured with -DCMAKE_INSTALL_PREFIX=/usr, the libraries are
# where Debian has them (lib/<triplet>).
set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_VENDOR "the bocst project")
set(CPACK_PACKAGE_CONTACT "the bocst maintainers <maintainers@users.noreply.github.com>")
set(CPACK_PACKAGE_DESCRIPTION_SUMMARY "Sphere-trees for FCL that grow on demand")
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_STRIP_FILES ON)
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_CONTROL_STRICT_PERMISSION ON)

# Without shared libraries there is nothing that programs need when they run.
set(CPACK_COMPONENTS_ALL dev)
if(BUILD_SHARED_LIBS)
  list(PREPEND CPACK_COMPONENTS_ALL library)
  set(needs_library "libbocst0 (= ${PROJECT_VERSION})")
endif()
if(TARGET bocst_program)
  list(APPEND CPACK_COMPONENTS_ALL tools)
endif()
if(TARGET bocst_python)
  list(APPEND CPACK_COMPONENTS_ALL python)
endif()

set(CPACK_DEBIAN_LIBRARY_PACKAGE_NAME libbocst0)
set(CPACK_DEBIAN_LIBRARY_PACKAGE_SECTION libs)
set(CPACK_DEBIAN_LIBRARY_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_PACKAGE_GENERATE_SHLIBS ON)
set(CPACK_DEBIAN_PACKAGE_GENERATE_SHLIBS_POLICY "=")
set(CPACK_COMPONENT_LIBRARY_DESCRIPTION
  "The libraries: what programs need that were built with libbocst-dev.")

set(CPACK_DEBIAN_DEV_PACKAGE_NAME libbocst-dev)
set(CPACK_DEBIAN_DEV_PACKAGE_SECTION libdevel)
set(CPACK_DEBIAN_DEV_PACKAGE_DEPENDS ${needs_library} libfcl-dev libeigen3-dev)
if(NOT BUILD_SHARED_LIBS)
  list(APPEND CPACK_DEBIAN_DEV_PACKAGE_DEPENDS libhwy-dev libassimp-dev zlib1g-dev libpugixml-dev)
endif()
list(JOIN CPACK_DEBIAN_DEV_PACKAGE_DEPENDS ", " CPACK_DEBIAN_DEV_PACKAGE_DEPENDS)
set(CPACK_COMPONENT_DEV_DESCRIPTION "Headers, CMake's find_package(bocst) and pkg-config files.
A model is one sphere at first and grows where collision queries need it.")

set(CPACK_DEBIAN_TOOLS_PACKAGE_NAME bocst)
set(CPACK_DEBIAN_TOOLS_PACKAGE_SECTION science)
set(CPACK_DEBIAN_TOOLS_PACKAGE_DEPENDS ${needs_library})
set(CPACK_DEBIAN_TOOLS_PACKAGE_SHLIBDEPS ON)
set(CPACK_COMPONENT_TOOLS_DESCRIPTION "The program bocst: the health of a mesh, its sphere-tree
as a page in 3D, single queries, and validation and timing compared with FCL.")

set(CPACK_DEBIAN_PYTHON_PACKAGE_NAME python3-bocst)
set(CPACK_DEBIAN_PYTHON_PACKAGE_SECTION python)
# The module is for one version of Python only.
set(CPACK_DEBIAN_PYTHON_PACKAGE_DEPENDS ${needs_library} ${BOCST_PYTHON_DEPENDS})
list(JOIN CPACK_DEBIAN_PYTHON_PACKAGE_DEPENDS ", " CPACK_DEBIAN_PYTHON_PACKAGE_DEPENDS)
set(CPACK_DEBIAN_PYTHON_PACKAGE_SHLIBDEPS ON)
set(CPACK_COMPONENT_PYTHON_DESCRIPTION "The Python module bocst: models, many poses and whole states
from NumPy arrays, and FCL's queries under the names of python-fcl.")
# Their own libraries are in another of these packages.
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS_PRIVATE_DIRS ${PROJECT_BINARY_DIR}/src)

# Each package says under which terms it is; a plain installation has the LICENSE once.
foreach(component library dev tools python)
  string(TOUPPER ${component} name)
  install(FILES LICENSE DESTINATION ${CMAKE_INSTALL_DATADIR}/doc/${CPACK_DEBIAN_${name}_PACKAGE_NAME} RENAME copyright
    COMPONENT ${component} EXCLUDE_FROM_ALL)
endforeach()

include(CPack)
