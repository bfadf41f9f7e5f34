"""The engines that references are computed with."""
