"""What searches find: records, reports, tables and pictures of designs."""
