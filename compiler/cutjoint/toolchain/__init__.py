"""The toolchain stage: C++ source becomes a binary, once for each content."""
