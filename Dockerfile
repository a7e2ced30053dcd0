# Build:    docker build -t fretwork .
# Run:      docker run -p 8080:8080 -v fretwork:/data --memory 1g fretwork
#           The first start prints the key of an administrator, once. To choose this key, write it to a file that user 10001 can
#           read, and name the file in FRETWORK_ADMIN_KEY_FILE, such as /run/secrets/fretwork.
# Add keys: docker exec <container> fretwork keys add anna --role submit
# A directory of the host that is mounted at /data must belong to user 10001: chown -R 10001:10001 <directory>
FROM debian:bookworm-slim AS manifests
WORKDIR /src
COPY . .
# A manifest can name benches and tests, whose files must exist.
RUN find . -type f ! -name 'Cargo.*' ! -path '*/benches/*' ! -path '*/tests/*' -delete \
    && find . -type f ! -name 'Cargo.*' -exec truncate --size 0 {} +

FROM rust:1.95-bookworm AS build
WORKDIR /src
# The dependencies have a layer of their own: it is built again only if a manifest changes. Cargo compiles them for empty
# crates, and forgets these.
COPY --from=manifests /src .
# SQLite takes no lock for each page and each allocation: 7 % of the processor time of a job.
ENV LIBSQLITE3_FLAGS="-USQLITE_ENABLE_MEMORY_MANAGEMENT -DSQLITE_DEFAULT_MEMSTATUS=0"
RUN --mount=type=cache,target=/usr/local/cargo/registry \
    for crate in . crates/*; do mkdir -p $crate/src && touch $crate/src/lib.rs; done \
    && echo 'fn main() {}' > src/main.rs \
    && cargo build --release --locked \
    && cargo clean --release --locked --workspace
COPY . .
RUN --mount=type=cache,target=/usr/local/cargo/registry \
    cargo build --release --locked

FROM debian:bookworm-slim
LABEL org.opencontainers.image.title="fretwork" \
      org.opencontainers.image.description="Fretting wear of round and line contacts as a service" \
      org.opencontainers.image.version="0.4.0" \
      org.opencontainers.image.licenses="MIT OR Apache-2.0"
# Fixed ids, so that the owner of a volume stays the same.
RUN groupadd --gid 10001 fretwork \
    && useradd --uid 10001 --gid 10001 --no-create-home --home-dir /data --shell /usr/sbin/nologin fretwork \
    && install --directory --owner 10001 --group 10001 --mode 700 /data
# The authorities whose certificates prove who a PostgreSQL of a provider is.
COPY --from=build /etc/ssl/certs/ca-certificates.crt /etc/ssl/certs/
COPY --from=build /src/target/release/fretwork /usr/local/bin/fretwork
COPY --from=build /src/LICENSE-MIT /src/LICENSE-APACHE /src/docs/third-party-licenses.md \
    /src/crates/study/src/stats/design/new-joe-kuo-6-LICENSE.txt /src/examples/literature/mccoll-2004-LICENSE.txt \
    /usr/local/share/doc/fretwork/
USER 10001:10001
VOLUME /data
EXPOSE 8080
# A server in a container must listen on all addresses, and so requires an access key. FRETWORK_NO_AUTH=true lets every client in.
# In another container of this image, `fretwork worker` answers monitors at the same port.
ENV FRETWORK_LISTEN=0.0.0.0:8080 FRETWORK_WORKER_LISTEN=0.0.0.0:8080 FRETWORK_DATA_DIR=/data
HEALTHCHECK --interval=30s --timeout=6s --start-period=5s CMD ["fretwork", "health"]
ENTRYPOINT ["fretwork"]
