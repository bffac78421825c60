"""Tests of the client against a simulation that is not there: `python -m unittest` in the folder `clients/python`."""
