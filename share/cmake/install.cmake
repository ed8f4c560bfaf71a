# Install and export rules: what find_package(bocst) and pkg-config need. Included last, from the top level.
option(BOCST_INSTALL "Make the install rules" ${PROJECT_IS_TOP_LEVEL})
if(NOT BOCST_INSTALL)
  return()
endif()
include(CMakePackageConfigHelpers)
set(bocst_config_dir ${CMAKE_INSTALL_LIBDIR}/cmake/bocst)

# What runs programs is in the component library, what builds them in dev; tools/ has the third, tools.
set(bocst_libraries bocst)
if(BOCST_BUILD_IO)
  list(APPEND bocst_libraries bocst_io)
  # libbocst_io finds libbocst under any prefix.
  set_target_properties(bocst_io PROPERTIES INSTALL_RPATH "$ORIGIN")
endif()
install(TARGETS ${bocst_libraries} EXPORT bocst-targets
  LIBRARY COMPONENT library NAMELINK_COMPONENT dev
  ARCHIVE COMPONENT dev)
install(DIRECTORY include/bocst DESTINATION ${CMAKE_INSTALL_INCLUDEDIR} COMPONENT dev)
# The documents keep their places to each other, so that their links lead somewhere.
install(FILES README.md CHANGELOG.md CONTRIBUTING.md CITATION.cff DESTINATION ${CMAKE_INSTALL_DOCDIR} COMPONENT dev)
install(DIRECTORY share/doc share/examples share/models DESTINATION ${CMAKE_INSTALL_DOCDIR}/share COMPONENT dev
  PATTERN "*.in" EXCLUDE)
# Debian's packages have it under a name of its own (debian.cmake).
install(FILES LICENSE DESTINATION ${CMAKE_INSTALL_DOCDIR} COMPONENT not_debian)
install(EXPORT bocst-targets NAMESPACE bocst:: FILE bocstTargets.cmake DESTINATION ${bocst_config_dir} COMPONENT dev)

configure_package_config_file(${CMAKE_CURRENT_LIST_DIR}/bocstConfig.cmake.in ${PROJECT_BINARY_DIR}/bocstConfig.cmake
  INSTALL_DESTINATION ${bocst_config_dir})
write_basic_package_version_file(${PROJECT_BINARY_DIR}/bocstConfigVersion.cmake COMPATIBILITY ${BOCST_COMPATIBILITY})
install(FILES ${PROJECT_BINARY_DIR}/bocstConfig.cmake ${PROJECT_BINARY_DIR}/bocstConfigVersion.cmake
  DESTINATION ${bocst_config_dir} COMPONENT dev)

# So that ROS 2 finds it as a package of a workspace.
file(STRINGS package.xml ros_version REGEX "<version>")
if(NOT ros_version MATCHES ">${PROJECT_VERSION}<")
  message(FATAL_ERROR "package.xml is of another version: ${ros_version}")
endif()
install(FILES package.xml DESTINATION ${CMAKE_INSTALL_DATADIR}/bocst COMPONENT dev)
file(WRITE ${PROJECT_BINARY_DIR}/ament_marker "")
install(FILES ${PROJECT_BINARY_DIR}/ament_marker RENAME bocst COMPONENT dev
  DESTINATION ${CMAKE_INSTALL_DATADIR}/ament_index/resource_index/packages)

# The .pc files speak of their own place, so that the prefix can be chosen at install time, too.
file(RELATIVE_PATH pc_to_include ${CMAKE_INSTALL_FULL_LIBDIR}/pkgconfig ${CMAKE_INSTALL_FULL_INCLUDEDIR})
if(BUILD_SHARED_LIBS)
  # One word, so that no tool puts its parts in another order.
  set(pc_bocst_libs "-lbocst -Wl,--push-state,--no-as-needed,-lbocst,--pop-state")
  set(pc_io_static "")
else()
  set(pc_bocst_libs "-lbocst -lhwy -lepoxy -ldl")
  set(pc_io_static " -lassimp -lpugixml")
endif()
set(pc_names bocst)
if(BOCST_BUILD_IO)
  list(APPEND pc_names bocst-io)
endif()
foreach(name IN LISTS pc_names)
  configure_file(${CMAKE_CURRENT_LIST_DIR}/${name}.pc.in ${PROJECT_BINARY_DIR}/${name}.pc @ONLY)
  install(FILES ${PROJECT_BINARY_DIR}/${name}.pc DESTINATION ${CMAKE_INSTALL_LIBDIR}/pkgconfig COMPONENT dev)
endforeach()

if(PROJECT_IS_TOP_LEVEL)
  include(${CMAKE_CURRENT_LIST_DIR}/debian.cmake)
endif()
