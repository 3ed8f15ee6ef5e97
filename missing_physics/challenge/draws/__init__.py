"""Drawing a case from its number: robot, manoeuvre, controller, sensors, and what is hidden."""
