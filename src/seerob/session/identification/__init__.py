"""Masses, friction and torque constants of an arm, from the log of an excitation."""
