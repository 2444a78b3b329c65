"""The few compiled inner loops."""

from seerob.kernels._kept_loops import keep_loops

keep_loops()
