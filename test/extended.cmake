# Tests of what surrounds the library: other oracles and drivers, compilers and how they link, documents, browsers,
# clusters, packages. They take half of the time of all tests; tools/test --all runs them, too.

# The same tests once more with another oracle wherever a test leaves the choice open.
function(bocst_repeat_with_oracle oracle)
  foreach(name IN LISTS ARGN)
    gtest_discover_tests(${name} DISCOVERY_TIMEOUT 60 TEST_PREFIX ${oracle}. TEST_LIST ${name}_${oracle}
      PROPERTIES TIMEOUT 600 ENVIRONMENT BOCST_ORACLE=${oracle})
  endforeach()
endfunction()

bocst_repeat_with_oracle(compute tree_test collide_test distance_test threads_test)
bocst_repeat_with_oracle(occlusion tree_test collide_test)

# The oracles once more on other drivers of Mesa: zink (OpenGL on Vulkan, here on lavapipe), and softpipe, which has
# OpenGL 3.3 only.
function(bocst_test_on_driver driver name)
  add_test(NAME ${driver}.${name} COMMAND ${ARGN})
  set_tests_properties(${driver}.${name} PROPERTIES TIMEOUT 600
    ENVIRONMENT "GALLIUM_DRIVER=${driver};LIBGL_ALWAYS_SOFTWARE=1")
endfunction()
file(GLOB BOCST_LAVAPIPE /usr/share/vulkan/icd.d/lvp_icd*.json)
if(BOCST_LAVAPIPE)
  # How much surface the paper's own form loses is no property of a driver, and takes long to draw.
  bocst_test_on_driver(zink gl_test gl_test --gtest_filter=-Occlusion.SampledQueriesLoseSurface)
  bocst_test_on_driver(zink broken_driver_test broken_driver_test)
  bocst_test_on_driver(zink oracle_test oracle_test --gtest_filter=*/compute:*/occlusion)
  bocst_test_on_driver(zink gpu_test gpu_test --gtest_filter=*GrowTogether*walks:WalksOnTheDevice*)
  if(BOCST_BUILD_TOOLS)
    bocst_test_on_driver(zink validate bocst_program validate ${PROJECT_SOURCE_DIR}/share/models/link.obj
      ${PROJECT_SOURCE_DIR}/share/models/gripper.obj --oracle compute --contacts --poses 100)
  endif()
else()
  message(STATUS "No lavapipe (mesa-vulkan-drivers): the oracles are not tested on zink")
endif()
bocst_test_on_driver(softpipe gl_test gl_test --gtest_filter=Occlusion.*:Device.SoftwareIs*)
bocst_test_on_driver(softpipe oracle_test oracle_test --gtest_filter=*/occlusion)

add_subdirectory(dispatch)

if(BOCST_BUILD_TOOLS)
  add_test(NAME gl_environments COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/program/gl_environments.sh
    $<TARGET_FILE:bocst_program> ${PROJECT_SOURCE_DIR}/share/models)
  set_tests_properties(gl_environments PROPERTIES TIMEOUT 600)

  find_program(BOCST_BROWSER NAMES chromium chromium-browser)
  if(BOCST_BROWSER)
    add_test(NAME pages COMMAND Python3::Interpreter ${CMAKE_CURRENT_SOURCE_DIR}/program/page_test.py
      $<TARGET_FILE:bocst_program> ${PROJECT_SOURCE_DIR}/share/models)
    set_tests_properties(pages PROPERTIES TIMEOUT 600 COST 40)
  else()
    message(STATUS "bocst: no chromium: the test of pages is left out")
  endif()
  # planners.md compiles for a minute: a test of its own. Programs that are built there without sanitizers cannot use a
  # library that is built with them.
  set(run_documents Python3::Interpreter ${CMAKE_CURRENT_SOURCE_DIR}/documents/run.py ${PROJECT_SOURCE_DIR} ${PROJECT_BINARY_DIR})
  set(planners ${PROJECT_SOURCE_DIR}/share/doc/planners.md)
  file(GLOB documents CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/share/doc/*.md ${PROJECT_SOURCE_DIR}/share/examples/*/README.md)
  list(REMOVE_ITEM documents ${planners})
  if(NOT BOCST_SANITIZE)
    add_test(NAME documents COMMAND ${run_documents} ${PROJECT_SOURCE_DIR}/README.md ${PROJECT_SOURCE_DIR}/CHANGELOG.md ${documents})
    add_test(NAME planners COMMAND ${run_documents} ${planners})
    # Both may build what is not built yet.
    set_tests_properties(documents planners PROPERTIES TIMEOUT 900 COST 50 RESOURCE_LOCK build_folder)
  endif()
  find_program(BOCST_SLURM NAMES slurmctld PATHS /usr/sbin)
  if(BOCST_SLURM)
    add_test(NAME slurm COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/program/slurm_test.sh $<TARGET_FILE:bocst_program>
      ${PROJECT_SOURCE_DIR}/share/examples/cluster)
    set_tests_properties(slurm PROPERTIES TIMEOUT 600 COST 60)
  else()
    message(STATUS "No Slurm (slurm-wlm): the example for clusters is tested with GNU parallel only")
  endif()
endif()

# What is built and installed, by whom and how.
add_test(NAME configure COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/package/configure.sh ${PROJECT_SOURCE_DIR})
set_tests_properties(configure PROPERTIES TIMEOUT 600 COST 30)
if(BOCST_BUILD_IO)
  add_test(NAME package COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/package/run.sh ${PROJECT_BINARY_DIR})
  set_tests_properties(package PROPERTIES TIMEOUT 600 COST 20)
  add_test(NAME debian COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/package/debian.sh ${PROJECT_BINARY_DIR})
  set_tests_properties(debian PROPERTIES TIMEOUT 600 COST 30)
endif()
if(TARGET bocst_python)
  execute_process(COMMAND ${BOCST_PYTHON} -c "import setuptools, wheel, pip" RESULT_VARIABLE no_pip OUTPUT_QUIET ERROR_QUIET)
  if(no_pip)
    message(STATUS "No pip, setuptools or wheel (python3-pip): installing by pip is not tested")
  elseif(BUILD_SHARED_LIBS AND NOT BOCST_SANITIZE)
    add_test(NAME pip COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/package/pip.sh ${PROJECT_BINARY_DIR})
    set_tests_properties(pip PROPERTIES TIMEOUT 300)
  endif()
endif()
