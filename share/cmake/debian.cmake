# Debian packages: `cpack -G DEB` in the build folder. They are multiarch where CMAKE_INSTALL_LIBDIR is lib/<triplet>, which
# it is by default on Debian.
set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_VENDOR "the bocst project")
set(CPACK_PACKAGE_CONTACT "the bocst maintainers <maintainers@users.noreply.github.com>")
set(CPACK_PACKAGE_DESCRIPTION_SUMMARY "Sphere-trees for FCL that grow on demand")
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_STRIP_FILES ON)
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_CONTROL_STRICT_PERMISSION ON)

set(library_package libbocst${BOCST_SOVERSION})
# Without shared libraries there is nothing that programs need when they run.
set(CPACK_COMPONENTS_ALL dev)
if(BUILD_SHARED_LIBS)
  list(PREPEND CPACK_COMPONENTS_ALL library)
  set(needs_library "${library_package} (= ${PROJECT_VERSION})")
endif()
if(TARGET bocst_program)
  list(APPEND CPACK_COMPONENTS_ALL tools)
endif()
if(TARGET bocst_python)
  list(APPEND CPACK_COMPONENTS_ALL python)
endif()

set(CPACK_DEBIAN_LIBRARY_PACKAGE_NAME ${library_package})
set(CPACK_DEBIAN_LIBRARY_PACKAGE_SECTION libs)
set(CPACK_DEBIAN_LIBRARY_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_PACKAGE_GENERATE_SHLIBS ON)
set(CPACK_DEBIAN_PACKAGE_GENERATE_SHLIBS_POLICY ">=")
file(CONFIGURE OUTPUT debian/triggers CONTENT "activate-noawait ldconfig\n" @ONLY)
set(CPACK_DEBIAN_LIBRARY_PACKAGE_CONTROL_EXTRA ${PROJECT_BINARY_DIR}/debian/triggers)
set(CPACK_COMPONENT_LIBRARY_DESCRIPTION
  "The libraries: what programs need that were built with libbocst-dev.")

set(CPACK_DEBIAN_DEV_PACKAGE_NAME libbocst-dev)
set(CPACK_DEBIAN_DEV_PACKAGE_SECTION libdevel)
set(CPACK_DEBIAN_DEV_PACKAGE_DEPENDS ${needs_library} libfcl-dev libeigen3-dev)
if(NOT BUILD_SHARED_LIBS)
  list(APPEND CPACK_DEBIAN_DEV_PACKAGE_DEPENDS libhwy-dev)
  if(BOCST_BUILD_IO)
    list(APPEND CPACK_DEBIAN_DEV_PACKAGE_DEPENDS libassimp-dev zlib1g-dev libpugixml-dev)
  endif()
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

if(CMAKE_LIBRARY_ARCHITECTURE AND CMAKE_INSTALL_LIBDIR MATCHES "${CMAKE_LIBRARY_ARCHITECTURE}$")
  set(CPACK_DEBIAN_LIBRARY_PACKAGE_MULTI_ARCH same)
  set(CPACK_DEBIAN_DEV_PACKAGE_MULTI_ARCH same)
endif()

# Each package says under which terms it is and what changed; a plain installation has LICENSE and CHANGELOG.md once.
string(TIMESTAMP now "%a, %d %b %Y %H:%M:%S +0000" UTC)
file(CONFIGURE OUTPUT debian/changelog @ONLY CONTENT [[bocst (@PROJECT_VERSION@) unstable; urgency=medium

  * Version @PROJECT_VERSION@; libbocst-dev has its CHANGELOG.md.

 -- @CPACK_PACKAGE_CONTACT@  @now@
]])
find_program(BOCST_GZIP gzip REQUIRED)
execute_process(COMMAND ${BOCST_GZIP} -9nkf debian/changelog WORKING_DIRECTORY ${PROJECT_BINARY_DIR}
  COMMAND_ERROR_IS_FATAL ANY)
foreach(component library dev tools python)
  string(TOUPPER ${component} name)
  set(folder ${CMAKE_INSTALL_DATADIR}/doc/${CPACK_DEBIAN_${name}_PACKAGE_NAME})
  install(FILES LICENSE DESTINATION ${folder} RENAME copyright COMPONENT ${component} EXCLUDE_FROM_ALL)
  install(FILES ${PROJECT_BINARY_DIR}/debian/changelog.gz DESTINATION ${folder} COMPONENT ${component} EXCLUDE_FROM_ALL)
endforeach()

include(CPack)
