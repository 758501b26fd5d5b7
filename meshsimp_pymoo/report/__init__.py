"""Pictures of fronts and meshes, and the report of an experiment: tables, figures, findings."""
