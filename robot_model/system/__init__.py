"""Robustness against the operating system: interrupts, dying processes, partly written files."""
