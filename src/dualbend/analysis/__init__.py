"""What is learnt from runs and models: metrics, validation, figures."""
