"""The pages that people open in a browser: plain files, without a build step."""
