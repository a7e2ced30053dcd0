-- When a node that computed a piece was last found dead. Nodes that die together are found one after another, and count once.
ALTER TABLE study ADD COLUMN died BIGINT;
