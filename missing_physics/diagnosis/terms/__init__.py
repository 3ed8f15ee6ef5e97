"""Terms of an explanation: effects with their numbers, and bodies with mass properties that can be."""
