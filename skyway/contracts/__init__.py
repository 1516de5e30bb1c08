"""What crosses a wire between Skyway's processes, each message and body defined once."""
