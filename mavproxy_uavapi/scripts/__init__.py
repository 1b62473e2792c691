"""Mission scripts: uploaded programs that fly by the API, each in its own tmux session."""
