"""What the commands print and write: tables, motion files, study files, budgets of effects."""
