# Build:    docker build -t fretwork .
# Run:      docker run -p 8080:8080 -v fretwork:/data -e FRETWORK_ADMIN_KEY="$(openssl rand -hex 20)" fretwork
# Add keys: docker exec <container> fretwork keys add anna --role submit
FROM rust:1.95-bookworm AS build
WORKDIR /src
COPY . .
RUN cargo build --release --locked

FROM debian:bookworm-slim
RUN useradd --system --uid 10001 --no-create-home fretwork \
    && mkdir /data && chown fretwork /data
COPY --from=build /src/target/release/fretwork /usr/local/bin/fretwork
COPY --from=build /src/LICENSE-MIT /src/LICENSE-APACHE /src/docs/third-party-licenses.md /usr/local/share/doc/fretwork/
USER fretwork
VOLUME /data
EXPOSE 8080
# A server in a container must listen on all addresses. It then needs an access key to start,
# or FRETWORK_NO_AUTH=true, which lets every client in.
ENV FRETWORK_LISTEN=0.0.0.0:8080 FRETWORK_DATA_DIR=/data
HEALTHCHECK --interval=30s --timeout=6s --start-period=5s CMD ["fretwork", "health"]
ENTRYPOINT ["fretwork"]
