"""Tests of the client against a fake simulation: `python -m unittest` in the folder `clients/python`."""
