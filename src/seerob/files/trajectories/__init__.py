"""Motions read from files, checked once, then sampled; and the map of what is permitted along one."""
