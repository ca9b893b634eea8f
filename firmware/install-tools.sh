#!/bin/sh
# Install the Debian packages that build the firmware and run it without a board, where this user may.
exec "$(dirname "$0")/install-debian.sh" firmware gcc-avr avr-libc arduino-core-avr libsimavr-dev libelf-dev g++
