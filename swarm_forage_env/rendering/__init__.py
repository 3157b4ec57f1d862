"""Pictures, films and plots. They read the state and never change it."""
