"""The scenario file: sections, loading, errors, schema, reference and template."""
