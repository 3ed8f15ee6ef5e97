"""What the operating system does to a running program: interrupts, processes that die, files half written."""
