// SPDX-License-Identifier: BSD-3-Clause
#include "commands/run.h"

int main(int argc, char** argv) { return bocst::program::run(argc, argv, BOCST_VERSION); }
