// Owner of the headers that tests have precompiled; see tests/CMakeLists.txt.
