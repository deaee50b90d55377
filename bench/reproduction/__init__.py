"""The paper's figures re-drawn and its claims re-measured: see bench/reproduce.py."""
