"""A recorded flight for other tools: tables, and tracks for globes."""
