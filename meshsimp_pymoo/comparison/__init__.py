"""Whole comparisons from one YAML file: what it may say (`config`), and doing it (`runner`)."""
