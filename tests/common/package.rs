//! Nothing: the tests stand in the binaries beside this file.
