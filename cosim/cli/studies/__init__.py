"""Commands that study: closed forms, trials, charts, speed."""
