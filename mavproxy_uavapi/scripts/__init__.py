"""Mission scripts: uploaded programs that fly by the API, each run in a tmux session of its own."""
