"""What every other room uses: quantities and checks of what is given, messages, files, CSV and TOML."""
