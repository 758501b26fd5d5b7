"""Meshes, triangulations and errors: arrays in, arrays out, no optimisation."""
